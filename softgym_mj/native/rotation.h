// Rotations and poses in double precision, as MuJoCo's functions of these names compute them.

#ifndef SOFTGYM_MJ_NATIVE_ROTATION_H_
#define SOFTGYM_MJ_NATIVE_ROTATION_H_

#include <cmath>

namespace softgym_mj {
namespace {

constexpr double kLeast = 1e-15;  // mjMINVAL.

inline void Normalize4(double q[4]) {
  const double norm = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  if (norm < kLeast) {
    q[0] = 1, q[1] = q[2] = q[3] = 0;
  } else if (std::fabs(norm - 1) > kLeast) {
    const double inverse = 1 / norm;
    for (int k = 0; k < 4; ++k) q[k] *= inverse;
  }
}

inline void MulQuat(const double a[4], const double b[4], double out[4]) {
  out[0] = a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3];
  out[1] = a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2];
  out[2] = a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1];
  out[3] = a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0];
}

inline void RotVecQuat(const double v[3], const double q[4], double out[3]) {
  if (v[0] == 0 && v[1] == 0 && v[2] == 0) {
    out[0] = out[1] = out[2] = 0;
  } else if (q[0] == 1 && q[1] == 0 && q[2] == 0 && q[3] == 0) {
    for (int k = 0; k < 3; ++k) out[k] = v[k];
  } else {
    const double t[3] = {q[0] * v[0] + q[2] * v[2] - q[3] * v[1], q[0] * v[1] + q[3] * v[0] - q[1] * v[2],
                         q[0] * v[2] + q[1] * v[1] - q[2] * v[0]};
    out[0] = v[0] + 2 * (q[2] * t[2] - q[3] * t[1]);
    out[1] = v[1] + 2 * (q[3] * t[0] - q[1] * t[2]);
    out[2] = v[2] + 2 * (q[1] * t[1] - q[2] * t[0]);
  }
}

// Converts a quaternion to a rotation matrix in row-major order.
inline void Quat2Mat(const double q[4], double out[9]) {
  if (q[0] == 1 && q[1] == 0 && q[2] == 0 && q[3] == 0) {
    for (int k = 0; k < 9; ++k) out[k] = k % 4 == 0;
    return;
  }
  const double q00 = q[0] * q[0], q01 = q[0] * q[1], q02 = q[0] * q[2], q03 = q[0] * q[3], q11 = q[1] * q[1];
  const double q12 = q[1] * q[2], q13 = q[1] * q[3], q22 = q[2] * q[2], q23 = q[2] * q[3], q33 = q[3] * q[3];
  out[0] = q00 + q11 - q22 - q33;
  out[4] = q00 - q11 + q22 - q33;
  out[8] = q00 - q11 - q22 + q33;
  out[1] = 2 * (q12 - q03);
  out[2] = 2 * (q13 + q02);
  out[3] = 2 * (q12 + q03);
  out[5] = 2 * (q23 - q01);
  out[6] = 2 * (q13 - q02);
  out[7] = 2 * (q23 + q01);
}

}  // namespace
}  // namespace softgym_mj

#endif  // SOFTGYM_MJ_NATIVE_ROTATION_H_
