// SPDX-License-Identifier: MIT
#include "skeletex/model/method.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <deque>

#include "skeletex/model/error.h"

namespace skeletex {
namespace {

/// A deque, as references to its entries stay valid when it grows.
std::deque<MethodTraits>& table() {
  static std::deque<MethodTraits> methods{{"spd", true}, {"vsm", false}};
  return methods;
}

}  // namespace

const MethodTraits& traits_of(Method method) { return table().at(static_cast<std::size_t>(method)); }

std::vector<Method> all_methods() {
  std::vector<Method> methods;
  for (std::size_t i = 0; i < table().size(); ++i) methods.push_back(static_cast<Method>(i));
  return methods;
}

std::vector<std::string> method_names() {
  std::vector<std::string> names;
  for (const MethodTraits& traits : table()) names.push_back(traits.name);
  return names;
}

Method method_named(const std::string& name) {
  for (const Method method : all_methods())
    if (to_string(method) == name) return method;
  throw InputError(
      fmt::format("\"{}\" is no parameterization method; known are {}", name, fmt::join(method_names(), ", ")));
}

Method add_method_traits(MethodTraits traits) {
  const std::vector<std::string> names = method_names();
  if (std::find(names.begin(), names.end(), traits.name) != names.end())
    throw InputError(
        fmt::format("a parameterization method \"{}\" is there already; choose another name", traits.name));
  table().push_back(std::move(traits));
  return static_cast<Method>(table().size() - 1);
}

}  // namespace skeletex
