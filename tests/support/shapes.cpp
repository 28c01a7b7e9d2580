// SPDX-License-Identifier: MIT
#include "support/shapes.h"
