// The cloth contact's inner loops for any processor.

#include "contact_kernels_impl.h"

namespace softgym_mj {
namespace {

struct Four {
  float v[4];

  Four() = default;
  explicit Four(float a) : v{a, a, a, a} {}
  Four(float a, float b, float c, float d) : v{a, b, c, d} {}
  static Four Load(const float* p) { return {p[0], p[1], p[2], p[3]}; }
  void Store(float* p) const {
    for (int k = 0; k < 4; ++k) p[k] = v[k];
  }
  Four Vector() const { return {v[0], v[1], v[2], 0.0f}; }
};
inline Four operator+(Four a, Four b) {
  return {a.v[0] + b.v[0], a.v[1] + b.v[1], a.v[2] + b.v[2], a.v[3] + b.v[3]};
}
inline Four operator-(Four a, Four b) {
  return {a.v[0] - b.v[0], a.v[1] - b.v[1], a.v[2] - b.v[2], a.v[3] - b.v[3]};
}
inline Four operator*(Four a, Four b) {
  return {a.v[0] * b.v[0], a.v[1] * b.v[1], a.v[2] * b.v[2], a.v[3] * b.v[3]};
}
inline float Dot(Four a, Four b) { return a.v[0] * b.v[0] + a.v[1] * b.v[1] + a.v[2] * b.v[2]; }
inline float Dot4(Four a, Four b) { return Dot(a, b) + a.v[3] * b.v[3]; }

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
    Scan,           NearEdges,           NearTriangles,
    SweepRows<Four>, SweepSprings<Four>, ExtendRows<Four>, ExtendSprings<Four>};

}  // namespace softgym_mj
