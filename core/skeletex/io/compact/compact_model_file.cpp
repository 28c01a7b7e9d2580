// SPDX-License-Identifier: MIT
#include "skeletex/io/compact/compact_model_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <fstream>

#include "skeletex/compact/compact_file.h"
#include "skeletex/compact/decode_model.h"
#include "skeletex/io/check_model.h"
#include "skeletex/io/read_file.h"
#include "skeletex/model/error.h"

namespace skeletex {

bool is_compact_file(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::array<char, 4> first{};
  file.read(first.data(), first.size());
  return file.gcount() == static_cast<std::streamsize>(first.size()) && is_compact({first.data(), first.size()});
}

CompactModel read_compact_file(const std::filesystem::path& path) {
  return read_compact(read_file(path), path.string());
}

SkeletexModel read_compact_model(const std::filesystem::path& path, const CompactFileOptions& options) {
  const std::string where = path.string();
  std::string bytes = read_file(path);
  const PrefixRule rule = options.bytes ? PrefixRule::kPrefix : PrefixRule::kWhole;
  if (options.bytes && *options.bytes < bytes.size()) bytes.resize(*options.bytes);
  const CompactModel compact = read_compact(bytes, where, rule);
  try {
    SkeletexModel model = decode_model(compact, options.size ? octaves_for(compact, *options.size) : 0);
    check_model(model, where);
    return model;
  } catch (const IoError&) {
    throw;
  } catch (const Error& error) {
    throw IoError(fmt::format("{}: {}", where, error.what()));
  }
}

}  // namespace skeletex
