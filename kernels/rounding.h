// SPDX-License-Identifier: MIT
// floor() and ceil() of what an int can hold; PoCL 3.1 makes more of theirs.

int floor_of(float x) { return (int)x - (x < (float)(int)x); }
int ceil_of(float x) { return (int)x + (x > (float)(int)x); }
