# For builds against the ROS wheels from PyPI only, by -DCMAKE_PROJECT_INCLUDE: the targets in
# those wheels name include directories of the machine that built them, and CMake refuses
# directories that do not exist. A ROS installation needs none of this.

function(drop_missing_include_directories)
  get_property(targets DIRECTORY PROPERTY IMPORTED_TARGETS)
  foreach(target IN LISTS targets)
    get_target_property(directories ${target} INTERFACE_INCLUDE_DIRECTORIES)
    set(existing "")
    foreach(directory IN LISTS directories)
      if(directory MATCHES "^\\$<" OR EXISTS "${directory}")
        list(APPEND existing "${directory}")
      endif()
    endforeach()
    set_target_properties(${target} PROPERTIES INTERFACE_INCLUDE_DIRECTORIES "${existing}")
  endforeach()
endfunction()

# Deferred: the targets appear as CMakeLists.txt finds its packages.
cmake_language(DEFER CALL drop_missing_include_directories)
