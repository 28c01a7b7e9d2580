// SPDX-License-Identifier: MIT
#include "skeletex/cl/program_cache.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <span>
#include <string_view>

namespace skeletex {
namespace {

constexpr std::string_view kMagic = "skeletex program 1\n";
constexpr std::size_t kMaxEntries = 256;

std::uint64_t fnv1a(std::span<const unsigned char> bytes) {
  std::uint64_t hash = 0xcbf29ce484222325u;
  for (const unsigned char byte : bytes) hash = (hash ^ byte) * 0x100000001b3u;
  return hash;
}

std::span<const unsigned char> bytes_of(std::string_view text) { return {reinterpret_cast<const unsigned char*>(text.data()), text.size()}; }

std::filesystem::path entry_path(const std::filesystem::path& folder, const std::string& key) {
  return folder / fmt::format("{:016x}.clbin", fnv1a(bytes_of(key)));
}

struct EntryHeader {
  std::uint64_t key_size, binary_size, checksum;
};

void remove_old_entries(const std::filesystem::path& folder) {
  std::vector<std::pair<std::filesystem::file_time_type, std::filesystem::path>> entries;
  for (const auto& entry : std::filesystem::directory_iterator(folder))
    if (entry.path().extension() == ".clbin") entries.emplace_back(entry.last_write_time(), entry.path());
  if (entries.size() <= kMaxEntries) return;
  std::sort(entries.begin(), entries.end());
  for (std::size_t i = 0; i + kMaxEntries < entries.size(); ++i) std::filesystem::remove(entries[i].second);
}

}  // namespace

std::filesystem::path program_cache_folder() {
  if (const char* folder = std::getenv("SKELETEX_CACHE_DIR")) return std::string_view(folder) == "off" ? "" : folder;
  if (const char* base = std::getenv("XDG_CACHE_HOME"); base && *base) return std::filesystem::path(base) / "skeletex";
  if (const char* home = std::getenv("HOME"); home && *home) return std::filesystem::path(home) / ".cache" / "skeletex";
  return {};
}

std::optional<std::vector<unsigned char>> load_program_binary(const std::filesystem::path& folder, const std::string& key) {
  if (folder.empty()) return std::nullopt;
  std::error_code ignored;
  const std::filesystem::path path = entry_path(folder, key);
  const std::uintmax_t file_size = std::filesystem::file_size(path, ignored);
  if (ignored || file_size < kMagic.size() + sizeof(EntryHeader) + key.size()) return std::nullopt;
  std::ifstream in(path, std::ios::binary);
  std::string text(file_size, '\0');
  if (!in.read(text.data(), static_cast<std::streamsize>(text.size()))) return std::nullopt;
  if (!text.starts_with(kMagic)) return std::nullopt;
  EntryHeader header;
  std::memcpy(&header, text.data() + kMagic.size(), sizeof(header));
  const std::size_t key_begin = kMagic.size() + sizeof(header);
  if (header.key_size != key.size() || header.binary_size != text.size() - key_begin - key.size()) return std::nullopt;
  if (std::string_view(text).substr(key_begin, key.size()) != key) return std::nullopt;
  const auto binary = bytes_of(std::string_view(text).substr(key_begin + key.size()));
  if (fnv1a(binary) != header.checksum) return std::nullopt;
  return std::vector<unsigned char>(binary.begin(), binary.end());
}

bool save_program_binary(const std::filesystem::path& folder, const std::string& key, const std::vector<unsigned char>& binary) {
  if (folder.empty()) return false;
  const std::filesystem::path path = entry_path(folder, key);
  const std::filesystem::path temporary = path.string() + fmt::format(".{}", ::getpid());
  std::error_code ignored;
  try {
    std::filesystem::create_directories(folder);
    std::ofstream out(temporary, std::ios::binary | std::ios::trunc);
    const EntryHeader header{key.size(), binary.size(), fnv1a(binary)};
    out << kMagic;
    out.write(reinterpret_cast<const char*>(&header), sizeof(header));
    out << key;
    out.write(reinterpret_cast<const char*>(binary.data()), static_cast<std::streamsize>(binary.size()));
    out.close();
    if (!out) {
      std::filesystem::remove(temporary, ignored);
      return false;
    }
    std::filesystem::rename(temporary, path);
    remove_old_entries(folder);
    return true;
  } catch (const std::filesystem::filesystem_error&) {
    std::filesystem::remove(temporary, ignored);
    return false;
  }
}

}  // namespace skeletex
