// SPDX-License-Identifier: MIT
// Loaded before Oclgrind 21.10, whose check for uninitialised values does not see fills and copies of buffers, and
// keeps the size of an old buffer for the new one in its place; what kernels write behind a first write that is shorter
// than its buffer counts as never written. So fills and copies become writes of whole buffers, and no buffer is given
// back.
#include <CL/cl.h>

#include <cstring>
#include <vector>

cl_int clEnqueueFillBuffer(cl_command_queue queue, cl_mem buffer, const void* pattern, size_t pattern_size,
                           size_t offset, size_t size, cl_uint wait_count, const cl_event* waits, cl_event* event) {
  std::vector<char> bytes(size);
  for (size_t i = 0; i < size; i += pattern_size) std::memcpy(bytes.data() + i, pattern, pattern_size);
  return clEnqueueWriteBuffer(queue, buffer, CL_TRUE, offset, size, bytes.data(), wait_count, waits, event);
}

cl_int clEnqueueCopyBuffer(cl_command_queue queue, cl_mem from, cl_mem to, size_t from_offset, size_t to_offset,
                           size_t size, cl_uint wait_count, const cl_event* waits, cl_event* event) {
  size_t whole = 0;
  cl_int code = clGetMemObjectInfo(to, CL_MEM_SIZE, sizeof(whole), &whole, nullptr);
  std::vector<char> bytes(whole);
  if (code == CL_SUCCESS)
    code = clEnqueueReadBuffer(queue, to, CL_TRUE, 0, whole, bytes.data(), wait_count, waits, nullptr);
  if (code == CL_SUCCESS)
    code = clEnqueueReadBuffer(queue, from, CL_TRUE, from_offset, size, bytes.data() + to_offset, 0, nullptr, nullptr);
  if (code != CL_SUCCESS) return code;
  return clEnqueueWriteBuffer(queue, to, CL_TRUE, 0, whole, bytes.data(), 0, nullptr, event);
}

cl_int clReleaseMemObject(cl_mem) { return CL_SUCCESS; }
