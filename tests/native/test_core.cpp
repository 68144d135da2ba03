#define DOCTEST_CONFIG_IMPLEMENT_WITH_MAIN
#include <doctest/doctest.h>

#include <numeric>
#include <stdexcept>

#include "core/mesh_measures.hpp"
#include "core/parallel.hpp"
#include "core/predicates.hpp"
#include "shapes.hpp"

using namespace rlacd;

TEST_CASE("a parallel loop does every item once, nested or not, in chunks of any size") {
  for (const int threads : {1, 2, 5})
    for (const std::size_t chunk : {1, 7, 100}) {
      std::vector<std::int64_t> sums(50);
      const auto row = [&](std::size_t i) {
        std::vector<std::int64_t> products(i);
        parallel_for(i, threads, [&](std::size_t j) { products[j] += static_cast<std::int64_t>(i * j); }, chunk);
        sums[i] += std::accumulate(products.begin(), products.end(), std::int64_t{0});
      };
      parallel_for(sums.size(), threads, row);
      for (std::int64_t i = 0; i < 50; ++i) CHECK(sums[i] == i * i * (i - 1) / 2);
    }
}

TEST_CASE("an exception in a parallel loop reaches the caller, and the pool goes on") {
  for (int again = 0; again < 20; ++again) {
    const auto fail = [](std::size_t i) {
      if (i == 37) throw std::runtime_error("item 37");
    };
    CHECK_THROWS_WITH(parallel_for(100, 4, fail), "item 37");
  }
}

TEST_CASE("what stops a thread stops the loops in it, unless it is shielded") {
  Stop stop;
  const ThisStop installed(&stop);
  std::atomic<int> done{0};
  const auto loop = [&] { parallel_for(1000, 3, [&](std::size_t) { ++done; }); };
  stop.trip_after(100);
  CHECK_THROWS_AS(loop(), Stopped);
  CHECK(done < 100);
  stop.shield(true);
  loop();
  CHECK(done >= 1000);
}

TEST_CASE("the side of a plane is exact") {
  Random random(1);
  for (int i = 0; i < 20000; ++i) {
    const int reach = i % 2 == 0 ? 2 : 1 << 16;  // products of three differences fit into 53 bits
    const Vec3 a = random.grid_point(reach), b = random.grid_point(reach), c = random.grid_point(reach),
               d = random.grid_point(reach);
    const double determinant = dot(cross(b - a, c - a), d - a);
    REQUIRE(orient3d_exact(a, b, c, d) == (determinant > 0) - (determinant < 0));
  }
}

TEST_CASE("volume and area of a box are those of the formulas") {
  Random random(2);
  for (int i = 0; i < 100; ++i) {
    const Vec3 half = random.point(1), h = {std::fabs(half.x), std::fabs(half.y), std::fabs(half.z)};
    const Mesh mesh = box(h, random.point(3));
    CHECK(mesh_volume(mesh) == doctest::Approx(8 * h.x * h.y * h.z));
    CHECK(mesh_area(mesh) == doctest::Approx(8 * (h.x * h.y + h.y * h.z + h.z * h.x)));
  }
}
