// Angles, roots, powers and logarithms by sums, products, quotients and square roots alone, which IEEE 754 rounds the
// same everywhere. Those of C libraries and of numpy have other last bits from system to system and on processors with
// FMA, and every comparison that they decide could fall either way.
#pragma once

namespace rlacd {

// The angle in (-pi, pi] whose sine and cosine are in these proportions; 0 if both are 0.
double angle_of(double sine, double cosine);

double cube_root(double x);  // of a negative x, x itself

double logarithm(double x);  // natural; -infinity unless x > 0

double power(double x, double exponent);  // 0 unless x > 0

}  // namespace rlacd
