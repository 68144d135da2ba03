#include "core/elementary.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/geometry.hpp"

namespace rlacd {
namespace {

constexpr double kLogarithmOfTwo = 0.693147180559945309417232121458;

// The series of the arc tangent and of its hyperbolic sibling end at this power of an argument below 0.2.
constexpr int kLastPower = 23;

// x + s x^3 / 3 + s^2 x^5 / 5 + ... for s = -1, the arc tangent, and s = 1, the inverse hyperbolic tangent.
double arc_series(double x, double sign) {
  const double square = sign * x * x;
  double sum = 0;
  for (int odd = kLastPower; odd > 0; odd -= 2) sum = 1.0 / odd + square * sum;
  return x * sum;
}

// The series ends at a power of an argument below 0.35.
double exponential(double x) {
  constexpr int kTerms = 14;
  const double twos = std::floor(x / kLogarithmOfTwo + 0.5), rest = x - twos * kLogarithmOfTwo;
  double sum = 1;
  for (int term = kTerms; term > 0; --term) sum = 1 + rest / term * sum;
  return std::ldexp(sum, static_cast<int>(twos));
}

}  // namespace

double angle_of(double sine, double cosine) {
  double y = std::fabs(sine), x = std::fabs(cosine);
  const double longer = std::max(x, y);
  if (!(longer > 0)) return 0;
  y /= longer, x /= longer;
  double tangent = y / (std::sqrt(x * x + y * y) + x);  // of half the acute angle
  for (int halved = 0; halved < 2; ++halved) tangent /= 1 + std::sqrt(1 + tangent * tangent);
  const double acute = 8 * arc_series(tangent, -1), positive = cosine < 0 ? kPi - acute : acute;
  return sine < 0 ? -positive : positive;
}

// Newton's method.
double cube_root(double x) {
  if (!(x > 0) || std::isinf(x)) return x;
  int exponent = 0;
  double mantissa = std::frexp(x, &exponent);
  while (exponent % 3 != 0) {
    mantissa *= 2;
    --exponent;
  }
  double root = 1;
  for (int i = 0; i < 8; ++i) root -= (root * root * root - mantissa) / (3 * root * root);
  return std::ldexp(root, exponent / 3);
}

double logarithm(double x) {
  if (!(x > 0)) return -kInfinity;
  if (std::isinf(x)) return x;
  int exponent = 0;
  double mantissa = std::frexp(x, &exponent);
  if (mantissa * mantissa < 0.5) mantissa *= 2, --exponent;  // between the roots of 1/2 and of 2
  return exponent * kLogarithmOfTwo + 2 * arc_series((mantissa - 1) / (mantissa + 1), 1);
}

double power(double x, double exponent) { return x > 0 ? exponential(exponent * logarithm(x)) : 0; }

}  // namespace rlacd
