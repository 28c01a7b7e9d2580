// SPDX-License-Identifier: MIT
#pragma once
#include <string>
#include <vector>

namespace skeletex::cli {

/// Rows of text under a head, columns aligned: the first to the left, the others to the right.
class Table {
 public:
  explicit Table(std::vector<std::string> head) : rows_{std::move(head)} {}
  void add(std::vector<std::string> row);
  std::string text() const;

 private:
  std::vector<std::vector<std::string>> rows_;
};

}  // namespace skeletex::cli
