// SPDX-License-Identifier: MIT
#include <gtest/gtest.h>

namespace skeletex {
TEST(Segment, Placeholder) {}
}  // namespace skeletex
