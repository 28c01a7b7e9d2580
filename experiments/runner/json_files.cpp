// SPDX-License-Identifier: MIT
#include "json_files.h"

#include "skeletex/io/atomic_file.h"
#include "skeletex/io/read_file.h"

namespace skeletex {

namespace fs = std::filesystem;

void write_json_file(const fs::path& path, const OrderedJson& json) {
  write_text_atomically(path, json.dump(1, ' ', false, OrderedJson::error_handler_t::replace) + "\n");
}

std::optional<OrderedJson> read_json_file(const fs::path& path) {
  std::error_code ignored;
  if (!fs::exists(path, ignored)) return std::nullopt;
  OrderedJson json = OrderedJson::parse(read_file(path), nullptr, false);
  return json.is_discarded() ? std::nullopt : std::optional(std::move(json));
}

}  // namespace skeletex
