// SPDX-License-Identifier: MIT
#pragma once
#include <optional>

#include "experiment.h"

namespace skeletex {

/// Writes atomically; text that is no UTF-8 is made so.
/// \throw IoError
void write_json_file(const std::filesystem::path& path, const OrderedJson& json);
/// Nothing where there is no such file, or no JSON in it.
std::optional<OrderedJson> read_json_file(const std::filesystem::path& path);

}  // namespace skeletex
