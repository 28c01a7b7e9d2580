# SPDX-License-Identifier: MIT
# The Debian package: the programs, their man pages, the documentation and example skeletons. Kernels, shaders and the page of
# `view` are inside the program. `scripts/package.sh` makes it.
set(doc_folder ${CMAKE_INSTALL_DATAROOTDIR}/doc/skeletex)
install(FILES ${CMAKE_CURRENT_LIST_DIR}/copyright ${PROJECT_SOURCE_DIR}/README.md ${PROJECT_SOURCE_DIR}/CHANGELOG.md
  DESTINATION ${doc_folder} COMPONENT tools)
install(DIRECTORY ${PROJECT_SOURCE_DIR}/docs DESTINATION ${doc_folder} COMPONENT tools
  FILES_MATCHING PATTERN "*.md" PATTERN pictures EXCLUDE PATTERN replication EXCLUDE)
install(DIRECTORY ${PROJECT_SOURCE_DIR}/configs/skeletons/ DESTINATION ${doc_folder}/examples COMPONENT tools
  FILES_MATCHING PATTERN "*.skeleton.json" PATTERN limits EXCLUDE)

set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME skeletex)
set(CPACK_PACKAGE_CONTACT "The Skeletex authors")
set(CPACK_STRIP_FILES ON)
set(CPACK_COMPONENTS_ALL tools Unspecified)  # not the library's headers
set(CPACK_COMPONENTS_GROUPING ALL_COMPONENTS_IN_ONE)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_INSTALL_DEFAULT_DIRECTORY_PERMISSIONS OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE WORLD_READ WORLD_EXECUTE)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SECTION graphics)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_DEPENDS "pocl-opencl-icd | opencl-icd, libegl1")
set(CPACK_DEBIAN_PACKAGE_RECOMMENDS "libegl-mesa0, libgl1-mesa-dri, fonts-dejavu-core")
set(CPACK_DEBIAN_PACKAGE_DESCRIPTION
"Encodes a closed triangle mesh and its skeleton as one texture of vector displacements, and makes closed meshes of any
 resolution from it, in any pose. Models can be morphed, filtered, measured, drawn, and joined part by part. Computes with OpenCL.")
include(CPack)
