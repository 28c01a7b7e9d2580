// SPDX-License-Identifier: MIT
#pragma once
#include <nlohmann/json.hpp>

#include "skeletex/model/texture.h"

namespace skeletex {

/// Adds an entry to SkeletexModel::encoder_settings.
inline void record_setting(SkeletexModel& model, const char* key, const nlohmann::json& value) {
  nlohmann::json settings = nlohmann::json::parse(model.encoder_settings, nullptr, false);
  if (!settings.is_object()) settings = nlohmann::json::object();
  settings[key] = value;
  model.encoder_settings = settings.dump();
}

}  // namespace skeletex
