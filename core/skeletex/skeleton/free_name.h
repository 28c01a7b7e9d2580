// SPDX-License-Identifier: MIT
#pragma once
#include <set>
#include <string>

namespace skeletex {

/// A name as wanted, else the first of name_2, name_3, .. that is not taken. It is taken then.
inline std::string free_name(const std::string& wanted, std::set<std::string>& taken) {
  std::string name = wanted;
  for (int i = 2; !taken.insert(name).second; ++i) name = wanted + "_" + std::to_string(i);
  return name;
}

}  // namespace skeletex
