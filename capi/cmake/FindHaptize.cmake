# Finds the C interface of haptize, as capi/install.sh installs it.
#
#   list(APPEND CMAKE_MODULE_PATH PREFIX/share/haptize/cmake)
#   find_package(Haptize REQUIRED)                    # CMAKE_PREFIX_PATH holds PREFIX
#   target_link_libraries(program Haptize::Haptize)
#
# Defines Haptize_FOUND, Haptize_INCLUDE_DIR, Haptize_LIBRARY and the target Haptize::Haptize.
find_path(Haptize_INCLUDE_DIR haptize.h)
find_library(Haptize_LIBRARY haptize)

include(FindPackageHandleStandardArgs)
find_package_handle_standard_args(Haptize REQUIRED_VARS Haptize_LIBRARY Haptize_INCLUDE_DIR)

if(Haptize_FOUND AND NOT TARGET Haptize::Haptize)
  add_library(Haptize::Haptize UNKNOWN IMPORTED)
  set_target_properties(Haptize::Haptize PROPERTIES
    IMPORTED_LOCATION "${Haptize_LIBRARY}"
    INTERFACE_INCLUDE_DIRECTORIES "${Haptize_INCLUDE_DIR}")
endif()
mark_as_advanced(Haptize_INCLUDE_DIR Haptize_LIBRARY)
