// SPDX-License-Identifier: MIT
#include "skeletex/device/kernel_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <optional>
#include <sstream>
#include <vector>

#include "skeletex/model/error.h"

namespace skeletex {
namespace {

// A kernel is taken from a program that is built already, else from the first program here that has its file. Some
// commands need nothing but metro.cl; `encode` needs reconstruct.cl for its layers.
const std::vector<std::vector<std::string_view>> kPrograms{
    {"metro.cl"},
    {"reconstruct.cl", "pose.cl", "regular_grid.cl", "blend.cl", "transfer.cl"},
    {"segment.cl", "vsm.cl", "elimination.cl", "encode.cl", "unfold.cl", "snap.cl", "fit.cl", "lattice.cl", "metro.cl",
     "spd.cl", "reconstruct.cl"},
    {"filter.cl", "orientation.cl"}};

std::string load(std::string_view file) {
  if (const char* folder = std::getenv("SKELETEX_KERNEL_DIR"); folder && *folder) {
    const std::string path = fmt::format("{}/{}", folder, file);
    std::ifstream in(path, std::ios::binary);
    if (!in) throw DeviceError(fmt::format("{}: no such kernel file; check SKELETEX_KERNEL_DIR", path));
    std::ostringstream text;
    text << in.rdbuf();
    return text.str();
  }
  for (const EmbeddedKernelFile& embedded : embedded_kernel_files())
    if (embedded.name == file) return std::string(embedded.text);
  throw DeviceError(fmt::format("the library holds no kernel file \"{}\"", file));
}

struct Inclusion {
  std::string file;
  bool is_open = true;
};

void append_source(std::string& out, const std::string& file, std::vector<Inclusion>& included) {
  const auto known =
      std::find_if(included.begin(), included.end(), [&](const Inclusion& other) { return other.file == file; });
  if (known != included.end() && known->is_open)
    throw DeviceError(fmt::format("the kernel file \"{}\" includes itself", file));
  if (known != included.end()) return;
  const std::size_t index = included.size();
  included.push_back({file});
  out += fmt::format("#line 1 \"{}\"\n", file);
  std::istringstream in(load(file));
  std::string line;
  for (int number = 1; std::getline(in, line); ++number) {
    constexpr std::string_view kInclude = "#include \"";
    if (line.starts_with(kInclude)) {
      append_source(out, line.substr(kInclude.size(), line.find('"', kInclude.size()) - kInclude.size()), included);
      out += fmt::format("#line {} \"{}\"\n", number + 1, file);
    } else {
      out += line;
      out += '\n';
    }
  }
  included[index].is_open = false;
}

std::optional<std::string> line_of(const std::string& file, int number) {
  std::string text;
  try {
    text = load(file);
  } catch (const DeviceError&) {
    return std::nullopt;  // a file of the driver's own
  }
  std::istringstream in(text);
  std::string line;
  for (int i = 0; i < number; ++i)
    if (!std::getline(in, line)) return std::nullopt;
  return line;
}

std::string_view trim(std::string_view text) {
  const auto begin = text.find_first_not_of(" \t\r");
  return begin == std::string_view::npos ? "" : text.substr(begin, text.find_last_not_of(" \t\r") - begin + 1);
}

struct Place {
  std::string file;
  int line = 0, column = 0;  ///< from 1; column 0: unknown
};

/// The first "name.cl:12" or "name.h:12:5" of a log line.
std::optional<Place> place_in(const std::string& log_line) {
  for (const std::string_view ending : {".cl:", ".h:"}) {
    const auto colon = log_line.find(ending);
    if (colon == std::string::npos) continue;
    std::size_t begin = colon;
    while (begin > 0 && (std::isalnum(static_cast<unsigned char>(log_line[begin - 1])) || log_line[begin - 1] == '_'))
      --begin;
    const char* const end = log_line.data() + log_line.size();
    Place place{log_line.substr(begin, colon - begin) + std::string(ending.substr(0, ending.size() - 1))};
    const auto line = std::from_chars(log_line.data() + colon + ending.size(), end, place.line);
    if (line.ec != std::errc()) continue;
    if (line.ptr != end && *line.ptr == ':') std::from_chars(line.ptr + 1, end, place.column);
    return place;
  }
  return std::nullopt;
}

}  // namespace

std::vector<std::vector<std::string_view>> programs_with(std::string_view file) {
  std::vector<std::vector<std::string_view>> found;
  std::copy_if(kPrograms.begin(), kPrograms.end(), std::back_inserter(found),
               [&](const auto& program) { return std::find(program.begin(), program.end(), file) != program.end(); });
  if (found.empty()) found.push_back({file});
  return found;
}

std::string kernel_source(std::span<const std::string_view> files) {
  std::string out;
  std::vector<Inclusion> included;
  for (const std::string_view file : files) append_source(out, std::string(file), included);
  return out;
}

std::string quote_kernel_lines(std::string_view build_log) {
  std::vector<std::string> lines;
  std::istringstream in{std::string(build_log)};
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  while (!lines.empty() && trim(lines.back()).find_first_not_of('\0') == std::string_view::npos) lines.pop_back();

  constexpr std::size_t kMaxLines = 100;
  std::string out;
  for (std::size_t i = 0; i < lines.size(); ++i) {
    if (i == kMaxLines) {
      out += fmt::format("... and {} lines more\n", lines.size() - i);
      break;
    }
    out += lines[i] + '\n';
    const auto place = place_in(lines[i]);
    if (!place) continue;
    const auto text = line_of(place->file, place->line);
    if (!text || trim(*text).empty()) continue;
    // Some drivers (NVIDIA) quote the line themselves.
    if (i + 1 < lines.size() && lines[i + 1].find(trim(*text)) != std::string::npos) continue;
    out += fmt::format("{:>6} | {}\n", place->line, *text);
    if (place->column > 0 && place->column <= static_cast<int>(text->size()) + 1)
      out += fmt::format("{:>6} | {:>{}}\n", "", "^", place->column);
  }
  return out;
}

}  // namespace skeletex
