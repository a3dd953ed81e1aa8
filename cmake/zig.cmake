# The C++ compiler of the package ziglang, for machines that have none, and for wheels: it links for old systems and for
# other processors. The environment variable ZIG_TARGET names the system, for example aarch64-linux-gnu.2.28.
set(CMAKE_CXX_COMPILER ${CMAKE_CURRENT_LIST_DIR}/zig-c++)
set(CMAKE_AR ${CMAKE_CURRENT_LIST_DIR}/zig-ar CACHE FILEPATH "")
set(CMAKE_RANLIB ${CMAKE_CURRENT_LIST_DIR}/zig-ranlib CACHE FILEPATH "")
if("$ENV{ZIG_TARGET}" MATCHES "^aarch64")
  set(CMAKE_SYSTEM_NAME Linux)
  set(CMAKE_SYSTEM_PROCESSOR aarch64)
endif()
# links share the cache of the compiled C++ library, and processes of zig may wait for each other's locks for ever
set_property(GLOBAL PROPERTY JOB_POOLS zig_links=1)
set(CMAKE_JOB_POOL_LINK zig_links)
