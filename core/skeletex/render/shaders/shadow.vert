// SPDX-License-Identifier: MIT
#version 450
layout(location = 0) in vec3 position;
layout(location = 0) uniform mat4 light_projection;
void main() { gl_Position = light_projection * vec4(position, 1.0); }
