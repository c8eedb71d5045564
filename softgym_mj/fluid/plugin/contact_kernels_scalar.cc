// The cloth contact's inner loops for any processor.

#include <math.h>

#include "contact_kernels_impl.h"

namespace softgym_mj {
namespace {

struct Eight {
  float v[kLanes];

  Eight() = default;
  explicit Eight(float a) {
    for (float& f : v) f = a;
  }
  static Eight Load(const float* p) { return Make([p](int i) { return p[i]; }); }
  void Store(float* p) const {
    for (int i = 0; i < kLanes; ++i) p[i] = v[i];
  }
  static void LoadVertices(const float* move, const int* vertex, Eight* x, Eight* y, Eight* z,
                           Eight* w) {
    for (int i = 0; i < kLanes; ++i) {
      const float* u = move + 4 * vertex[i];
      x->v[i] = u[0], y->v[i] = u[1], z->v[i] = u[2], w->v[i] = u[3];
    }
  }
  static void StoreVertices(const Eight& x, const Eight& y, const Eight& z, const Eight&,
                            const int* vertex, float* move) {
    for (int i = 0; i < kLanes; ++i) {
      float* u = move + 4 * vertex[i];
      u[0] = x.v[i], u[1] = y.v[i], u[2] = z.v[i];
    }
  }
  template <class F>
  static Eight Make(F f) {
    Eight made;
    for (int i = 0; i < kLanes; ++i) made.v[i] = f(i);
    return made;
  }
};
inline Eight operator+(const Eight& a, const Eight& b) {
  return Eight::Make([&](int i) { return a.v[i] + b.v[i]; });
}
inline Eight operator-(const Eight& a, const Eight& b) {
  return Eight::Make([&](int i) { return a.v[i] - b.v[i]; });
}
inline Eight operator*(const Eight& a, const Eight& b) {
  return Eight::Make([&](int i) { return a.v[i] * b.v[i]; });
}
inline Eight operator/(const Eight& a, const Eight& b) {
  return Eight::Make([&](int i) { return a.v[i] / b.v[i]; });
}
// Of what is compared, 1 is true and 0 false.
inline Eight operator|(const Eight& a, const Eight& b) {
  return Eight::Make([&](int i) { return a.v[i] > b.v[i] ? a.v[i] : b.v[i]; });
}
inline Eight operator<(const Eight& a, const Eight& b) {
  return Eight::Make([&](int i) { return a.v[i] < b.v[i] ? 1.0f : 0.0f; });
}
inline Eight Differ(const Eight& a, const Eight& b) {
  return Eight::Make([&](int i) { return a.v[i] != b.v[i] ? 1.0f : 0.0f; });
}
inline Eight Max(const Eight& a, const Eight& b) {
  return Eight::Make([&](int i) { return a.v[i] > b.v[i] ? a.v[i] : b.v[i]; });
}
inline Eight Abs(const Eight& a) {
  return Eight::Make([&](int i) { return fabsf(a.v[i]); });
}
inline Eight Sqrt(const Eight& a) {
  return Eight::Make([&](int i) { return sqrtf(a.v[i]); });
}
inline Eight Select(const Eight& which, const Eight& a, const Eight& b) {
  return Eight::Make([&](int i) { return which.v[i] != 0 ? a.v[i] : b.v[i]; });
}
inline float Sum(const Eight& a) {
  return ((a.v[0] + a.v[1]) + (a.v[2] + a.v[3])) + ((a.v[4] + a.v[5]) + (a.v[6] + a.v[7]));
}
inline bool Any(const Eight& a) { return Sum(a) != 0; }

int Scan(const BoxView& boxes, int first, int last, const float* box, int* out) {
  int found = 0;
  for (int i = first; i < last; ++i) {
    out[found] = boxes.id[i];
    found += boxes.high[0][i] >= box[0] && boxes.low[1][i] <= box[4] && boxes.high[1][i] >= box[1] &&
             boxes.low[2][i] <= box[5] && boxes.high[2][i] >= box[2];
  }
  return found;
}

// One by one a quick look costs as much as a thorough one.
int NearEdges(const EdgeView&, int, const int* near, int count, float, int* out) {
  for (int i = 0; i < count; ++i) out[i] = near[i];
  return count;
}

int NearTriangles(const TriangleView&, const float*, const float*, const int* near, int count, float,
                  int* out) {
  for (int i = 0; i < count; ++i) out[i] = near[i];
  return count;
}

}  // namespace

const ContactKernels kScalarContactKernels = {
    Scan,           NearEdges,       NearTriangles,    Sweep<Eight, 4>,
    Sweep<Eight, 2>, Extend<Eight, 4>, Extend<Eight, 2>};

}  // namespace softgym_mj
