// Linear layers with ReLU between them, in single precision: sums in one order, so the same bits on every machine.
//
// Input:  rows of features; for each layer its weights by input, then by output, and its bias by output.
// Output: rows of the last layer's outputs.
#pragma once

#include <cstddef>
#include <vector>

namespace rlacd {

struct Layer {
  const float *weights, *bias;
  std::size_t inputs, outputs;
};

std::vector<float> through_layers(const float* features, std::size_t rows, const std::vector<Layer>& layers);

}  // namespace rlacd
