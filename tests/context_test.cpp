// SPDX-License-Identifier: MIT
#include <gtest/gtest.h>

#include "skeletex/cl/context.h"
#include "skeletex/model/error.h"

namespace skeletex {

TEST(Context, RefusesAnUnknownDeviceAndListsTheOthers) {
  try {
    ClContext context("no such device");
    FAIL();
  } catch (const DeviceError& error) {
    EXPECT_NE(std::string(error.what()).find(list_devices().front().name), std::string::npos);
  }
}

TEST(Context, UploadsAndDownloadsUnchanged) {
  ClContext context;
  const std::vector<float> values{1, 2, 3.5f};
  EXPECT_EQ(context.download(context.upload(values)), values);
}

}  // namespace skeletex
