// SPDX-License-Identifier: MIT
// What a work-item of a group of ROW_ITEMS has written all of them can read from here on, in global or local memory
// (CLK_GLOBAL_MEM_FENCE, CLK_LOCAL_MEM_FENCE). A group of one has nothing to wait for.
#ifndef ROW_GROUP_H
#define ROW_GROUP_H

#if ROW_ITEMS > 1
#define WAIT_FOR_GROUP(memory) barrier(memory)
#else
#define WAIT_FOR_GROUP(memory)
#endif

#endif
