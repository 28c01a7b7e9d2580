// SPDX-License-Identifier: MIT
#pragma once
#include <optional>
#include <string>

#include "command.h"
#include "skeletex/compact/encode/search_compact.h"

namespace skeletex::cli {

/// What the user asks of a compact file.
struct CompactArguments {
  double max_error = 1e-4, quality = 50;
  long max_bytes = 0;
  int layer_steps = 64;
};
/// --max-error, --max-bytes and --quality, of which one may be given.
void add_compact_options(CLI::App& command, CompactArguments& arguments);
/// Whether one of them is given.
bool has_compact_option(const CLI::App& command);
bool is_compact_path(const std::string& path);

/// Writes a compact file, and warns of what it leaves out of the model.
/// \param reference  what the error is measured against: search_compact
/// \param size       of the texture that the file decodes to, where the command's --size is given
/// \return for the JSON
Json write_compact(ClContext& context, const SkeletexModel& model, const TriangleMesh* reference,
                   const CompactArguments& arguments, const CLI::App& command, int size, const std::string& path);
/// One line about it.
std::string compact_text(const Json& json);

}  // namespace skeletex::cli
