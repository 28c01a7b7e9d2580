// SPDX-License-Identifier: MIT
// Work-groups of the maps and of their elimination. On a CPU a group is one work-item, which needs no barriers: CPU
// compilers turn each barrier in a loop into a loop over work-items, which takes them seconds to tens of seconds.
// GROUP_BARRIERS: groups of more than one all the same, for tests.
#if ROW_ITEMS == 1 && !defined(GROUP_BARRIERS)
#define GROUP_IS_SINGLE
#define GROUP_KERNEL __attribute__((reqd_work_group_size(1, 1, 1)))
#define GROUP_BARRIER()
#define GROUP_ITEM 0
#define GROUP_ITEMS 1
// PoCL makes three copies of a kernel with all that is inlined in it, and compiles each.
#define GROUP_FUNCTION __attribute__((noinline))
#else
#define GROUP_KERNEL
#define GROUP_BARRIER() barrier(CLK_LOCAL_MEM_FENCE | CLK_GLOBAL_MEM_FENCE)
#define GROUP_ITEM ((int)get_local_id(0))
#define GROUP_ITEMS ((int)get_local_size(0))
#define GROUP_FUNCTION
#endif
