#include "decompose/network.hpp"

#include <algorithm>

#include "core/stop.hpp"

namespace rlacd {
namespace {

constexpr std::size_t kBlock = 16;  // rows that share each look at the weights

void through(const Layer& layer, const float* in, std::size_t rows, float* out) {
  for (std::size_t r = 0; r < rows; ++r) std::copy_n(layer.bias, layer.outputs, out + r * layer.outputs);
  for (std::size_t i = 0; i < layer.inputs; ++i) {
    const float* weights = layer.weights + i * layer.outputs;
    for (std::size_t r = 0; r < rows; ++r) {
      const float x = in[r * layer.inputs + i];
      float* sums = out + r * layer.outputs;
      for (std::size_t o = 0; o < layer.outputs; ++o) sums[o] += x * weights[o];
    }
  }
}

}  // namespace

std::vector<float> through_layers(const float* features, std::size_t rows, const std::vector<Layer>& layers) {
  std::vector<float> found;
  for (std::size_t first = 0; first < rows; first += kBlock) {
    poll_stop();
    const std::size_t count = std::min(kBlock, rows - first), inputs = layers.front().inputs;
    std::vector<float> values(features + first * inputs, features + (first + count) * inputs), next;
    for (const Layer& layer : layers) {
      if (&layer != &layers.front())
        for (float& value : values) value = std::max(value, 0.0F);
      next.resize(count * layer.outputs);
      through(layer, values.data(), count, next.data());
      values.swap(next);
    }
    found.insert(found.end(), values.begin(), values.end());
  }
  return found;
}

}  // namespace rlacd
