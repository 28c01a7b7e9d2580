// SPDX-License-Identifier: MIT
#pragma once
#include <filesystem>

namespace skeletex {

/// The record of a shard that has ended: FOLDER/shards/I-of-N.json.
std::filesystem::path shard_file(const std::filesystem::path& folder, int shard, int shards);
/// Removes the record of a shard, which runs again, and those of another number of shards.
void drop_shard_records(const std::filesystem::path& folder, int shard, int shards);

}  // namespace skeletex
