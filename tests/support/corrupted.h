// SPDX-License-Identifier: MIT
// Damage for files: what a reader must survive.
#pragma once
#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <random>
#include <sstream>
#include <string>

namespace skeletex {

inline void write_bytes(const std::filesystem::path& path, const std::string& bytes) {
  std::filesystem::remove(path);  // rather than truncate, which some file systems answer with a flush to disk
  std::ofstream(path, std::ios::binary).write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
}

inline std::string read_bytes(const std::filesystem::path& path) {
  std::ifstream in(path, std::ios::binary);
  std::ostringstream out;
  out << in.rdbuf();
  return out.str();
}

/// Calls `visit` with `count` damaged versions of a file: cut short, with bytes or numbers changed, blocks removed,
/// doubled or filled, and digits of text replaced. The same seed gives the same damage. The environment variable
/// SKELETEX_FUZZ multiplies the count, for a long run now and then.
inline void for_each_corruption(const std::string& file, int count, std::uint64_t seed,
                                const std::function<void(const std::string&)>& visit) {
  if (const char* factor = std::getenv("SKELETEX_FUZZ")) count *= std::max(1, std::atoi(factor));
  std::mt19937_64 random(seed);
  const auto below = [&](std::size_t n) { return static_cast<std::size_t>(random() % std::max<std::size_t>(n, 1)); };
  for (int i = 0; i < count; ++i) {
    std::string bytes = file;
    // Half of the damage goes into the first kilobyte, where the headers are.
    const auto place = [&] {
      return below(random() % 2 == 0 ? std::min<std::size_t>(bytes.size(), 1024) : bytes.size());
    };
    for (std::size_t hits = 1 + below(3); hits > 0 && !bytes.empty(); --hits) {
      const std::size_t at = place(), length = std::min(bytes.size() - at, 1 + below(16));
      switch (random() % 7) {
        case 0: bytes.resize(at); break;
        case 1: bytes[at] = static_cast<char>(random()); break;
        case 2: bytes[at] = static_cast<char>(bytes[at] ^ (1 << below(8))); break;
        case 3: bytes.erase(at, length); break;
        case 4: bytes.insert(at, bytes.substr(at, length)); break;
        case 5:
          std::fill_n(bytes.begin() + static_cast<std::ptrdiff_t>(at), length, random() % 2 == 0 ? '\xff' : '\0');
          break;
        case 6: {
          constexpr const char* kTokens[] = {"-1", "999999999", "4294967295",           "nan", "1e999", "",
                                             "\n", "#",         "99999999999999999999", "{",   "]",     "\\"};
          bytes.replace(at, std::min(bytes.size() - at, below(4)), kTokens[below(std::size(kTokens))]);
          break;
        }
      }
    }
    visit(bytes);
  }
}

}  // namespace skeletex
