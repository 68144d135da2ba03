// The exact sign of a 3x3 determinant of coordinate differences.
//
// Input:  four points with finite coordinates.
// Output: on which side of the plane through a, b, c the point d lies, without rounding error.
// Algorithm: first in double-double arithmetic, whose error bound settles nearly every point that is not exactly on the
// plane; then by floating-point expansions (Shewchuk, "Adaptive Precision Floating-Point Arithmetic and Fast Robust
// Geometric Predicates", 1997), in which every number is an unevaluated sum of non-overlapping doubles. Callers filter
// in plain doubles first; this is the slow path. Exact as long as no product under- or overflows (coordinates within
// about 1e-90 .. 1e90).
#pragma once

#include "core/geometry.hpp"

namespace rlacd {

// What rounding took from a product, exactly (Dekker 1971). std::fma(a, b, -product) should be the same, but is a call
// into the C library where the processor need not have it, and MinGW's rounds wrongly.
inline double product_error(double a, double b, double product) {
  constexpr double kHalves = 134217729;  // 2^27 + 1: cuts 53 bits in two
  const double a_high = kHalves * a - (kHalves * a - a), a_low = a - a_high;
  const double b_high = kHalves * b - (kHalves * b - b), b_low = b - b_high;
  return ((a_high * b_high - product) + a_high * b_low + a_low * b_high) + a_low * b_low;
}

// a - b as high + low, exactly.
struct ExactDifference {
  double high, low;
  ExactDifference(double a, double b) : high(a - b) {
    const double virtual_b = a - high;
    const double virtual_a = high + virtual_b;
    low = (a - virtual_a) + (virtual_b - b);
  }
};

// A sum of doubles, non-overlapping, in order of increasing magnitude, without zeros: its sign is its last term's.
template <int Capacity>
class Expansion {
 public:
  void add(double b) {
    double q = b;
    int kept = 0;
    for (int i = 0; i < size_; ++i) {
      const double sum = q + terms_[i];
      const double virtual_b = sum - q;
      const double rest = (q - (sum - virtual_b)) + (terms_[i] - virtual_b);
      q = sum;
      if (rest != 0) terms_[kept++] = rest;
    }
    if (q != 0) terms_[kept++] = q;
    size_ = kept;
  }

  // Adds sign * a * b exactly.
  void add_product(double a, double b) {
    const double high = a * b;
    const double low = product_error(a, b, high);
    if (low != 0) add(low);
    add(high);
  }
  void add_product(const ExactDifference& a, const ExactDifference& b, double sign) {
    add_product(sign * a.low, b.low);
    add_product(sign * a.low, b.high);
    add_product(sign * a.high, b.low);
    add_product(sign * a.high, b.high);
  }

  template <int Other>
  void add_scaled(const Expansion<Other>& e, double b) {
    for (int i = 0; i < e.size(); ++i) add_product(e.term(i), b);
  }

  int size() const { return size_; }
  double term(int i) const { return terms_[i]; }
  int sign() const { return size_ == 0 ? 0 : terms_[size_ - 1] > 0 ? 1 : -1; }

 private:
  double terms_[Capacity];
  int size_ = 0;
};

// A number of about 106 bits: high + low with |low| <= ulp(high) / 2.
struct DoubleDouble {
  double high = 0, low = 0;
};

inline DoubleDouble quick_sum(double high, double low) {
  const double sum = high + low;
  return {sum, low - (sum - high)};
}

inline DoubleDouble operator+(DoubleDouble a, DoubleDouble b) {
  const double sum = a.high + b.high;
  const double virtual_b = sum - a.high;
  const double rest = (a.high - (sum - virtual_b)) + (b.high - virtual_b);
  return quick_sum(sum, rest + (a.low + b.low));
}

inline DoubleDouble operator*(DoubleDouble a, DoubleDouble b) {
  const double product = a.high * b.high;
  return quick_sum(product, product_error(a.high, b.high, product) + (a.high * b.low + a.low * b.high));
}

inline DoubleDouble operator-(DoubleDouble a) { return {-a.high, -a.low}; }

// Sign of det[b-a, c-a, d-a]: +1 when d lies on the side the normal (b-a)x(c-a) points to, 0 when the four points are
// exactly coplanar.
inline int orient3d_exact(Vec3 a, Vec3 b, Vec3 c, Vec3 d) {
  for (int axis = 0; axis < 3; ++axis)  // faces of boxes: coplanar by one shared coordinate
    if (a[axis] == b[axis] && a[axis] == c[axis] && a[axis] == d[axis]) return 0;
  if (d == a || d == b || d == c) return 0;
  const ExactDifference b3[3] = {{b.x, a.x}, {b.y, a.y}, {b.z, a.z}};
  const ExactDifference c3[3] = {{c.x, a.x}, {c.y, a.y}, {c.z, a.z}};
  const ExactDifference d3[3] = {{d.x, a.x}, {d.y, a.y}, {d.z, a.z}};

  DoubleDouble estimate;
  for (int i = 0; i < 3; ++i) {
    const int j = (i + 1) % 3, k = (i + 2) % 3;
    const auto dd = [](const ExactDifference& x) { return DoubleDouble{x.high, x.low}; };
    estimate = estimate + (dd(b3[j]) * dd(c3[k]) + -(dd(b3[k]) * dd(c3[j]))) * dd(d3[i]);
  }
  // Every operation above is off by less than 2^-100 of the largest product |b-a||c-a||d-a|; there are fewer than 16.
  const double bound = 0x1p-96 * max_abs(b - a) * max_abs(c - a) * max_abs(d - a);
  if (estimate.high > bound) return 1;
  if (estimate.high < -bound) return -1;

  Expansion<192> determinant;
  for (int i = 0; i < 3; ++i) {
    const int j = (i + 1) % 3, k = (i + 2) % 3;
    Expansion<16> minor;  // b_j c_k - b_k c_j
    minor.add_product(b3[j], c3[k], 1);
    minor.add_product(b3[k], c3[j], -1);
    determinant.add_scaled(minor, d3[i].low);
    determinant.add_scaled(minor, d3[i].high);
  }
  return determinant.sign();
}

// Whether three points lie exactly on one line: all three 2x2 minors of their differences vanish.
inline bool collinear_exact(Vec3 a, Vec3 b, Vec3 c) {
  for (int i = 0; i < 3; ++i) {
    const int j = (i + 1) % 3;
    const ExactDifference u(b[i], a[i]), v(b[j], a[j]), s(c[i], a[i]), t(c[j], a[j]);
    Expansion<16> minor;
    minor.add_product(u, t, 1);
    minor.add_product(v, s, -1);
    if (minor.sign() != 0) return false;
  }
  return true;
}

}  // namespace rlacd
