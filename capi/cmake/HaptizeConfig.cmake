# Finds the C interface of haptize, as capi/install.sh installs it:
#
#   find_package(Haptize 0.1 REQUIRED)
#   target_link_libraries(program Haptize::Haptize)
#
# Haptize::Haptize is the shared library. On Linux Haptize::haptize_static is the static one, with what it needs of the system. Nothing here
# names the prefix: what was installed may be moved.
get_filename_component(haptize_prefix "${CMAKE_CURRENT_LIST_DIR}/../../.." ABSOLUTE)
if(NOT TARGET Haptize::Haptize)
  add_library(Haptize::Haptize SHARED IMPORTED)
  set_target_properties(Haptize::Haptize PROPERTIES INTERFACE_INCLUDE_DIRECTORIES "${haptize_prefix}/include")
  if(WIN32)
    set_target_properties(Haptize::Haptize PROPERTIES
      IMPORTED_LOCATION "${haptize_prefix}/bin/haptize_capi.dll"
      IMPORTED_IMPLIB "${haptize_prefix}/lib/haptize.lib")
  else()
    set_target_properties(Haptize::Haptize PROPERTIES
      IMPORTED_LOCATION "${haptize_prefix}/lib/libhaptize${CMAKE_SHARED_LIBRARY_SUFFIX}")
  endif()
  if(CMAKE_SYSTEM_NAME STREQUAL "Linux")
    add_library(Haptize::haptize_static STATIC IMPORTED)
    set_target_properties(Haptize::haptize_static PROPERTIES
      IMPORTED_LOCATION "${haptize_prefix}/lib/libhaptize.a"
      INTERFACE_INCLUDE_DIRECTORIES "${haptize_prefix}/include"
      INTERFACE_LINK_LIBRARIES "gcc_s;util;rt;pthread;m;dl;c")
  endif()
endif()
unset(haptize_prefix)
