# A layer is a static library of every source in its folder. It sees its own headers and those of the layers it names, no others:
# the include paths enforce the arrows of the README.
find_package(Threads REQUIRED)
find_package(PkgConfig REQUIRED)

set(HW_WARNINGS -Wall -Wextra -Wshadow -Wcast-qual -Wpointer-arith -Wvla -Wformat=2 -Wundef -Werror)
set(HW_C_WARNINGS -Wstrict-prototypes -Wmissing-prototypes)

function(hw_compile_options target)
  target_compile_options(${target} PRIVATE ${HW_WARNINGS} $<$<COMPILE_LANGUAGE:C>:${HW_C_WARNINGS}>)
  target_compile_definitions(${target} PRIVATE _GNU_SOURCE)
  if(HW_NATIVE)
    target_compile_options(${target} PRIVATE -march=native -ffp-contract=off)
  endif()
  if(HW_SANITIZE)
    target_compile_options(${target} PRIVATE -fsanitize=${HW_SANITIZE} -fno-sanitize-recover=all -fno-omit-frame-pointer)
    target_link_options(${target} PUBLIC -fsanitize=${HW_SANITIZE})
  endif()
endfunction()

# hw_layer(cells base textures scenes): folder `cells`, target hw_cells, linked to hw_base, ...
function(hw_layer name)
  file(GLOB sources CONFIGURE_DEPENDS ${CMAKE_CURRENT_SOURCE_DIR}/*.c
       ${CMAKE_CURRENT_SOURCE_DIR}/*/*.c)
  add_library(hw_${name} STATIC ${sources})
  target_include_directories(hw_${name} PUBLIC ${CMAKE_CURRENT_SOURCE_DIR})
  foreach(layer ${ARGN})
    target_link_libraries(hw_${name} PUBLIC hw_${layer})
  endforeach()
  target_link_libraries(hw_${name} PUBLIC m Threads::Threads)
  hw_compile_options(hw_${name})
endfunction()

# Third-party headers are never ours to warn about.
function(hw_system_package target module)
  pkg_check_modules(${module} REQUIRED IMPORTED_TARGET ${module})
  target_link_libraries(${target} PRIVATE PkgConfig::${module})
endfunction()
