# SPDX-License-Identifier: MIT
# Compiles all kernels once, and gives each test executable a copy of PoCL's cache; without it each would compile them.
#
#   cmake -D PROGRAM=skeletex -D FOLDER=pocl-cache -D NAMES=a,b -P seed_kernel_caches.cmake
set(ENV{POCL_CACHE_DIR} ${FOLDER}/all)
execute_process(COMMAND ${PROGRAM} devices --compile OUTPUT_QUIET COMMAND_ERROR_IS_FATAL ANY)
string(REPLACE "," ";" names ${NAMES})
foreach(name IN LISTS names)
  file(COPY ${FOLDER}/all/ DESTINATION ${FOLDER}/${name})
endforeach()
