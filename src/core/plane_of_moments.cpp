#include "plane_of_moments.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "simd.h"

namespace tabletop_perception {
namespace {

constexpr int LANES = LaneMoments::LANES;
constexpr int MIN_NEIGHBORS = 4;    // three points always lie on a plane, whatever they are
constexpr float MIN_WIDTH = 1e-3f;  // second over first eigenvalue; less is a line
constexpr int NEWTON_STEPS = 8;
constexpr float NONE = std::numeric_limits<float>::quiet_NaN();

}  // namespace

/// A covariance's smallest eigenvalue is the limit of Newton's method on the characteristic
/// polynomial from zero, which approaches it from below; the eigenvector is the longest cross
/// product of two rows of what is left of the matrix.
TABLETOP_SIMD_CLONES void fitPlanes(const LaneMoments& sums, LaneNormals& out) {
  float a[LANES], b[LANES], c[LANES], d[LANES], e[LANES],
      f[LANES];  // the upper triangle over its trace
  float m[LANES], w[LANES], t[LANES] = {};
  for (int l = 0; l < LANES; ++l) {
    const float inverse = 1 / std::max(sums.n[l], 1.0f);
    const float mx = sums.x[l] * inverse, my = sums.y[l] * inverse, mz = sums.z[l] * inverse;
    const float ca = sums.xx[l] * inverse - mx * mx, cb = sums.xy[l] * inverse - mx * my;
    const float cc = sums.xz[l] * inverse - mx * mz, cd = sums.yy[l] * inverse - my * my;
    const float ce = sums.yz[l] * inverse - my * mz, cf = sums.zz[l] * inverse - mz * mz;
    const float trace = ca + cd + cf, unit = 1 / std::max(trace, 1e-20f);
    a[l] = ca * unit;
    b[l] = cb * unit;
    c[l] = cc * unit;
    d[l] = cd * unit;
    e[l] = ce * unit;
    f[l] = cf * unit;
    // det(A - t I) = -t^3 + t^2 - m t + w
    m[l] = a[l] * d[l] - b[l] * b[l] + a[l] * f[l] - c[l] * c[l] + d[l] * f[l] - e[l] * e[l];
    w[l] = a[l] * (d[l] * f[l] - e[l] * e[l]) - b[l] * (b[l] * f[l] - c[l] * e[l]) +
           c[l] * (b[l] * e[l] - c[l] * d[l]);
  }
  for (int i = 0; i < NEWTON_STEPS; ++i)
    for (int l = 0; l < LANES; ++l) {
      const float value = ((1 - t[l]) * t[l] - m[l]) * t[l] + w[l];
      const float slope = (2 - 3 * t[l]) * t[l] - m[l];
      t[l] -= zeroUnless(slope < -1e-12f, value / slope);
    }
  for (int l = 0; l < LANES; ++l) {
    const float al = a[l] - t[l], dl = d[l] - t[l], fl = f[l] - t[l];
    const float bl = b[l], cl = c[l], el = e[l];
    const float ux = bl * el - cl * dl, uy = cl * bl - al * el,
                uz = al * dl - bl * bl;  // rows 1, 2
    const float vx = bl * fl - cl * el, vy = cl * cl - al * fl,
                vz = al * el - bl * cl;  // rows 1, 3
    const float wx = dl * fl - el * el, wy = el * cl - bl * fl,
                wz = bl * el - dl * cl;  // rows 2, 3
    const float u2 = ux * ux + uy * uy + uz * uz, v2 = vx * vx + vy * vy + vz * vz,
                w2 = wx * wx + wy * wy + wz * wz;
    const bool v_longer = v2 > u2;
    const float px = v_longer ? vx : ux, py = v_longer ? vy : uy, pz = v_longer ? vz : uz;
    const float p2 = v_longer ? v2 : u2;
    const bool w_longer = w2 > p2;
    const float qx = w_longer ? wx : px, qy = w_longer ? wy : py, qz = w_longer ? wz : pz;
    const float q2 = w_longer ? w2 : p2;

    // The middle eigenvalue is about m over the largest; on a line it vanishes.
    const bool good = (sums.n[l] >= MIN_NEIGHBORS) & (m[l] > MIN_WIDTH) & (q2 > 0);
    const float length = std::sqrt(good ? q2 : 1.0f);
    const float scale = good ? 1 / length : NONE;
    out.x[l] = qx * scale;
    out.y[l] = qy * scale;
    out.z[l] = qz * scale;
    const float least = t[l] > 0 ? t[l] : 0.0f;
    out.curvature[l] = good ? least : NONE;
  }
}

}  // namespace tabletop_perception
