// SPDX-License-Identifier: MIT
#include "skeletex/convert/parameterize/method.h"

#include <utility>

#include "skeletex/convert/parameterize/spd.h"
#include "skeletex/convert/parameterize/vsm.h"

namespace skeletex {
namespace {

/// The objects of the methods in the order of `Method`.
std::vector<std::unique_ptr<ParameterizationMethod>>& registry() {
  static std::vector<std::unique_ptr<ParameterizationMethod>> methods = [] {
    std::vector<std::unique_ptr<ParameterizationMethod>> built_in;
    built_in.push_back(make_spd_method());
    built_in.push_back(make_vsm_method());
    return built_in;
  }();
  return methods;
}

}  // namespace

const ParameterizationMethod& parameterization(Method method) {
  return *registry().at(static_cast<std::size_t>(method));
}

Method register_method(MethodTraits traits, std::unique_ptr<ParameterizationMethod> method) {
  const Method number = add_method_traits(std::move(traits));
  registry().push_back(std::move(method));
  return number;
}

std::vector<MapReport> map_charts(ClContext& context, std::span<const Method> methods, std::vector<Chart>& charts,
                                  const MapOptions& options) {
  std::vector<MapReport> reports(charts.size());
  for (const Method method : all_methods()) {
    std::vector<std::size_t> numbers;
    std::vector<Chart> own;
    for (std::size_t i = 0; i < charts.size(); ++i)
      if (methods[i] == method) {
        numbers.push_back(i);
        own.push_back(std::move(charts[i]));
      }
    if (own.empty()) continue;
    const std::vector<MapReport> own_reports = parameterization(method).map(context, own, options);
    for (std::size_t k = 0; k < own.size(); ++k) {
      charts[numbers[k]] = std::move(own[k]);
      reports[numbers[k]] = own_reports[k];
    }
  }
  return reports;
}

}  // namespace skeletex
