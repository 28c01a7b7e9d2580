// SPDX-License-Identifier: MIT
#include "skeletex/io/same_file.h"

#include <fmt/format.h>

#include "skeletex/model/error.h"

namespace skeletex {
namespace {

namespace fs = std::filesystem;

/// The path as it will be once its links are followed; a link that leads nowhere is followed too.
fs::path resolved(const fs::path& path) {
  std::error_code error;
  fs::path at = fs::absolute(path, error);
  for (int links = 0; links < 40 && fs::is_symlink(fs::symlink_status(at, error)); ++links) {
    const fs::path target = fs::read_symlink(at, error);
    at = target.is_absolute() ? target : at.parent_path() / target;
  }
  const fs::path whole = fs::weakly_canonical(at, error);
  return error ? at.lexically_normal() : whole;
}

}  // namespace

bool is_same_file(const fs::path& a, const fs::path& b) {
  std::error_code error;
  if (fs::equivalent(a, b, error) && !error) return true;
  return resolved(a) == resolved(b);
}

void check_not_an_input(const fs::path& output, std::initializer_list<fs::path> inputs) {
  for (const fs::path& input : inputs)
    if (!output.empty() && !input.empty() && is_same_file(output, input))
      throw InputError(fmt::format("{} is also the input {}, which would be lost; name another file", output.string(),
                                   input.string()));
}

}  // namespace skeletex
