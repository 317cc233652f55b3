# What reads files of others, and what jobs keep: a third of stream, without stages and commands. The sanitizers and the fuzzers
# build it by itself.
set(rooms check files formats import meshes points runtime)
list(TRANSFORM rooms REPLACE "(.+)" "${CMAKE_SOURCE_DIR}/stream/\\1/*.cpp")
file(GLOB_RECURSE reader_sources CONFIGURE_DEPENDS ${rooms})
list(APPEND reader_sources ${CMAKE_SOURCE_DIR}/stream/commands/break_lines.cpp
  ${CMAKE_SOURCE_DIR}/stream/commands/convert_mesh.cpp ${CMAKE_SOURCE_DIR}/stream/commands/face_groups.cpp)
