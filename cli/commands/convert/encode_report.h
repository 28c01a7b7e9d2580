// SPDX-License-Identifier: MIT
#pragma once
#include <string>

#include "command.h"
#include "skeletex/convert/encode_model.h"

namespace skeletex::cli {

/// The file that `encode` has written.
struct EncodedFile {
  std::string path;
  int width = 0, height = 0;
  double seconds = 0;  ///< from the first byte read to the last one written
};

/// All that is known about an encoding.
Json encode_report_json(const EncodeReport& report, const EncodedFile& file);
/// What a user can act on: size, time, errors.
std::string encode_report_text(const EncodeReport& report, const EncodedFile& file);
/// A table of the bones, what was done to the texels, and the times of the stages.
std::string encode_details_text(const EncodeReport& report);

}  // namespace skeletex::cli
