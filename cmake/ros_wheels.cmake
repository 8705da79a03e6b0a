# Include this with -DCMAKE_PROJECT_INCLUDE in builds against the ROS wheels from PyPI. In these wheels, the
# targets with generated Python support name include directories of the machine that built the wheel. CMake
# refuses directories that do not exist here, and this package must not export its own directories either.
# A build against a ROS installation does not need this file.

function(keep_include_directories_local)
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

  set(target ${PROJECT_NAME}__rosidl_generator_py)
  get_target_property(directories ${target} INTERFACE_INCLUDE_DIRECTORIES)
  list(TRANSFORM directories REPLACE "(.+)" "$<BUILD_INTERFACE:\\1>")
  set_target_properties(${target} PROPERTIES INTERFACE_INCLUDE_DIRECTORIES "${directories}")
endfunction()

# Deferred until CMakeLists.txt has defined the targets.
cmake_language(DEFER CALL keep_include_directories_local)
