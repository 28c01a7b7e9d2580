// SPDX-License-Identifier: MIT
#pragma once
#include <nlohmann/json.hpp>

#include "skeletex/model/texture.h"

namespace skeletex {

/// SkeletexModel::encoder_settings, parsed; an empty object where it is none. Two of them are more than a record: with
/// `prefilter` inner texels lie 1/16 of their second differences off the surface, unless they are snapped or fitted;
/// with `snap` beside their places of an regular grid.
inline nlohmann::json parsed_encoder_settings(const SkeletexModel& model) {
  nlohmann::json settings = nlohmann::json::parse(model.encoder_settings, nullptr, false);
  return settings.is_object() ? settings : nlohmann::json::object();
}

}  // namespace skeletex
