// Balls between walls: those that shrink until they touch another, and points that are pushed away from a surface, each
// step from the place on it that is nearest then.
#pragma once

#include <vector>

#include "surface/bvh.hpp"

namespace rlacd {

struct Pushed {
  std::vector<Vec3> best;     // the place farthest from the surface on each point's way
  std::vector<double> radii;  // how far that is
  std::vector<Vec3> ends;
};

// `times` steps of the given lengths, against the push along each point's unit vector `against`; 0 for none. A point
// nearer to the surface than `least` stays where it is.
Pushed pushed(const Bvh& surface, std::vector<Vec3> points, const std::vector<Vec3>& against,
              const std::vector<double>& steps, int times, double least, int threads);

// Radii of balls that touch the surface at a point, with their centre along its unit normal, and, seen from that, at
// least 60 degrees away from it; 0 for those that do not, or that are smaller than `least`. None is larger than `most`.
// Each shrinks until it touches another wall and nothing is inside (Ma, Bae and Choi 2012).
std::vector<double> held_balls(const Bvh& surface, const std::vector<Vec3>& points, const std::vector<Vec3>& normals,
                               double least, double most, int threads);

}  // namespace rlacd
