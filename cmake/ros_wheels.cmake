# For builds against the ROS wheels from PyPI only, by -DCMAKE_PROJECT_INCLUDE. The targets of
# generated Python support carry the include directories of the machine that built them. CMake
# refuses those that do not exist here, and ours must not be passed on in the same way.
# A build against a ROS installation needs none of this.

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

# Deferred: the targets appear as CMakeLists.txt is read.
cmake_language(DEFER CALL keep_include_directories_local)
