// Python bindings of the elementary functions, elementwise, and of networks.
#include "bind/released.hpp"
#include "core/elementary.hpp"
#include "decompose/network.hpp"

namespace rlacd {
namespace {

using NumbersIn = VectorIn<double>;
using FloatMatrixIn = ArrayIn<float, nb::ndim<2>>;

template <class Function>
std::vector<double> each(const NumbersIn& numbers, const Function& function) {
  std::vector<double> values(numbers.shape(0));
  for (std::size_t i = 0; i < values.size(); ++i) values[i] = function(numbers(i));
  return values;
}

std::vector<double> angles(const NumbersIn& sines, const NumbersIn& cosines) {
  require(sines.shape(0) == cosines.shape(0), "as many sines as cosines");
  std::vector<double> values(sines.shape(0));
  for (std::size_t i = 0; i < values.size(); ++i) values[i] = angle_of(sines(i), cosines(i));
  return values;
}

std::vector<float> network_outputs(const FloatMatrixIn& features, const std::vector<FloatMatrixIn>& weights,
                                   const std::vector<VectorIn<float>>& biases) {
  require(!weights.empty() && weights.size() == biases.size(), "one bias for each matrix of weights");
  std::vector<Layer> layers;
  for (std::size_t i = 0; i < weights.size(); ++i) {
    const std::size_t inputs = i == 0 ? features.shape(1) : weights[i - 1].shape(1);
    require(weights[i].shape(0) == inputs && weights[i].shape(1) == biases[i].shape(0), "layers do not fit together");
    layers.push_back({weights[i].data(), biases[i].data(), inputs, weights[i].shape(1)});
  }
  return through_layers(features.data(), features.shape(0), layers);
}

}  // namespace

void bind_numbers(nb::module_& m) {
  m.def("angles", released(angles), "sines"_a, "cosines"_a,
        "Angles [N] in (-pi, pi] whose sines and cosines are in these proportions; 0 where both are 0.");
  m.def("cube_roots", released([](const NumbersIn& x) { return each(x, cube_root); }), "x"_a,
        "Cube roots [N]; numbers below 0 stay as they are.");
  m.def("powers", released([](const NumbersIn& x, double exponent) {
          return each(x, [exponent](double own) { return power(own, exponent); });
        }),
        "x"_a, "exponent"_a, "Powers [N]; 0 of numbers that are not positive.");
  m.def("logarithms", released([](const NumbersIn& x) { return each(x, logarithm); }), "x"_a,
        "Natural logarithms [N]; -infinity of numbers that are not positive.");
  m.def("network_outputs", released(network_outputs), "features"_a, "weights"_a, "biases"_a,
        "Outputs [N * O] of layers with ReLU between them, for rows of features [N, I]; the weights of each layer "
        "[inputs, outputs].");
}

}  // namespace rlacd
