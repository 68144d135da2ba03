// Points that are pushed away from a surface, each step from the place on it that is nearest then.
#pragma once

#include <vector>

#include "surface/bvh.hpp"

namespace rlacd {

struct Pushed {
  std::vector<Vec3> best;     // the place farthest from the surface on each point's way
  std::vector<double> radii;  // how far that is
  std::vector<Vec3> ends;
};

// `times` steps of the given lengths, against the push along each point's unit vector `against`; 0 for none.
Pushed pushed(const Bvh& surface, std::vector<Vec3> points, const std::vector<Vec3>& against,
              const std::vector<double>& steps, int times, int threads);

}  // namespace rlacd
