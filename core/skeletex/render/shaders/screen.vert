// SPDX-License-Identifier: MIT
#version 450
// One triangle over the whole picture.
void main() { gl_Position = vec4(4.0 * float(gl_VertexID % 2) - 1.0, 4.0 * float(gl_VertexID / 2) - 1.0, 0.0, 1.0); }
