# Finds the C interface of haptize, as capi/install.sh installs it.
#
#   list(APPEND CMAKE_MODULE_PATH PREFIX/share/haptize/cmake)
#   find_package(Haptize REQUIRED)
#   target_link_libraries(program Haptize::Haptize)
#
# Defines Haptize_FOUND, Haptize_INCLUDE_DIR, Haptize_LIBRARY and the target Haptize::Haptize.
# Installed beside this file, unless CMAKE_PREFIX_PATH says otherwise.
get_filename_component(Haptize_PREFIX "${CMAKE_CURRENT_LIST_DIR}/../../.." ABSOLUTE)
find_path(Haptize_INCLUDE_DIR haptize.h PATHS "${Haptize_PREFIX}/include")
find_library(Haptize_LIBRARY haptize PATHS "${Haptize_PREFIX}/lib")

include(FindPackageHandleStandardArgs)
find_package_handle_standard_args(Haptize REQUIRED_VARS Haptize_LIBRARY Haptize_INCLUDE_DIR)

if(Haptize_FOUND AND NOT TARGET Haptize::Haptize)
  add_library(Haptize::Haptize UNKNOWN IMPORTED)
  set_target_properties(Haptize::Haptize PROPERTIES
    IMPORTED_LOCATION "${Haptize_LIBRARY}"
    INTERFACE_INCLUDE_DIRECTORIES "${Haptize_INCLUDE_DIR}")
endif()
mark_as_advanced(Haptize_INCLUDE_DIR Haptize_LIBRARY)
