// Convex polygons minus convex polytopes: see clip.hpp for input and output.
#include "cut/clip.hpp"

#include <algorithm>
#include <iterator>

namespace rlacd {

void Clipper::subtract(std::vector<Polygon>& polygons, const HalfSpaces& convex) {
  left_.clear();
  for (Polygon& polygon : polygons) {
    if (is_separated(polygon, convex)) {
      left_.push_back(std::move(polygon));
      continue;
    }
    cut_off_.clear();
    rest_ = polygon;
    for (const std::int32_t i : crossed_) {
      split(rest_, convex.planes->normal(i), convex.offset[i]);
      rest_.swap(inside_);
      if (rest_.empty()) break;
      if (!outside_.empty()) cut_off_.push_back(outside_);
    }
    if (rest_.empty())
      left_.push_back(std::move(polygon));
    else
      std::move(cut_off_.begin(), cut_off_.end(), std::back_inserter(left_));
  }
  polygons.swap(left_);
}

RLACD_WIDE bool Clipper::is_separated(const Polygon& polygon, const HalfSpaces& convex) {
  constexpr std::size_t kBlock = ConvexPlanes::kBlock;
  const double *x = convex.planes->x(), *y = convex.planes->y(), *z = convex.planes->z();
  crossed_.clear();
  for (std::size_t start = 0; start < convex.planes->size(); start += kBlock) {
    double least[kBlock], most[kBlock];  // heights of the corners above each plane
    std::fill(least, least + kBlock, std::numeric_limits<double>::infinity());
    std::fill(most, most + kBlock, -std::numeric_limits<double>::infinity());
    for (const Vec3 p : polygon)
      for (std::size_t i = 0; i < kBlock; ++i) {
        const std::size_t k = start + i;
        const double height = x[k] * p.x + y[k] * p.y + z[k] * p.z - convex.offset[k];
        least[i] = least[i] < height ? least[i] : height;
        most[i] = most[i] > height ? most[i] : height;
      }
    for (std::size_t i = 0; i < kBlock; ++i) {
      if (least[i] >= -kOnPlane) return true;
      if (most[i] > kOnPlane) crossed_.push_back(static_cast<std::int32_t>(start + i));
    }
  }
  return false;
}

// The parts of a polygon inside and outside a half-space. A polygon that only touches the plane stays whole: outside,
// or inside if it lies in the plane.
void Clipper::split(const Polygon& polygon, Vec3 normal, double offset) {
  inside_.clear();
  outside_.clear();
  const auto height = [&](Vec3 p) {
    const double h = dot(normal, p) - offset;
    return std::fabs(h) <= kOnPlane ? 0.0 : h;
  };
  double least = 0, most = 0;
  for (const Vec3 p : polygon) {
    const double h = height(p);
    least = std::min(least, h);
    most = std::max(most, h);
  }
  if (most <= 0) {
    inside_ = polygon;
    return;
  }
  if (least >= 0) {
    outside_ = polygon;
    return;
  }
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Vec3 p = polygon[i], q = polygon[i + 1 == polygon.size() ? 0 : i + 1];
    const double hp = height(p), hq = height(q);
    if (hp <= 0) inside_.push_back(p);
    if (hp >= 0) outside_.push_back(p);
    if ((hp < 0 && hq > 0) || (hp > 0 && hq < 0)) {
      const Vec3 crossing = p + (hp / (hp - hq)) * (q - p);
      inside_.push_back(crossing);
      outside_.push_back(crossing);
    }
  }
}

}  // namespace rlacd
