# What `cmake --install build/release` puts where, and the Debian packages of it: tessera (the program), libtessera-dev (the
# floors for C++) and python3-tessera (the module, where it was built). tools/package makes them.
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)

# The program. tessera-vdb stays out: it alone needs libopenvdb. tessera-gdal, which needs libgdal, is in where it was built.
install(TARGETS tessera RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT program)
if(TARGET tessera-gdal)
  install(TARGETS tessera-gdal RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT program OPTIONAL)
endif()
# What the program runs in its place on a processor without AVX2, where tools/package --portable has put it.
install(PROGRAMS ${CMAKE_BINARY_DIR}/tessera-portable DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT program OPTIONAL)
install(FILES README.md LICENSE DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT program)
install(FILES tools/COMMANDS.md tools/MEASURED.md DESTINATION ${CMAKE_INSTALL_DOCDIR}/tools COMPONENT program)
# Where Debian looks for it.
install(FILES LICENSE DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT program RENAME copyright)
install(FILES ${CMAKE_BINARY_DIR}/tools/manual/tessera.1.gz DESTINATION ${CMAKE_INSTALL_MANDIR}/man1 COMPONENT program)
install(FILES ${CMAKE_BINARY_DIR}/tools/manual/tessera.bash
  DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions COMPONENT program RENAME tessera)
# The page of `tessera view`, where tools/viewer/build has made it (its packages come from the network).
install(FILES ${CMAKE_SOURCE_DIR}/build/viewer/viewer.html ${CMAKE_SOURCE_DIR}/build/viewer/serve.py
  DESTINATION ${CMAKE_INSTALL_DATADIR}/tessera/viewer COMPONENT program OPTIONAL)

# The floors. <tessera/octree.h> and its like are the doors; the headers behind them keep the names that they have here.
set(package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/Tessera)
set(include_dir ${CMAKE_INSTALL_INCLUDEDIR}/tessera)
install(TARGETS tessera_flags tessera_octree tessera_solvers tessera_kernels tessera_stream EXPORT TesseraTargets
  ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT library)
install(EXPORT TesseraTargets NAMESPACE Tessera:: DESTINATION ${package_dir} COMPONENT library)
configure_package_config_file(tools/packaging/TesseraConfig.cmake.in ${CMAKE_BINARY_DIR}/package/TesseraConfig.cmake
  INSTALL_DESTINATION ${package_dir})
# Before 1.0 every minor version may break what was.
write_basic_package_version_file(${CMAKE_BINARY_DIR}/package/TesseraConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${CMAKE_BINARY_DIR}/package/TesseraConfig.cmake ${CMAKE_BINARY_DIR}/package/TesseraConfigVersion.cmake
  DESTINATION ${package_dir} COMPONENT library)
configure_file(tools/packaging/version.h.in ${CMAKE_BINARY_DIR}/package/version.h @ONLY)
install(FILES ${CMAKE_BINARY_DIR}/package/version.h DESTINATION ${include_dir} COMPONENT library)
foreach(floor octree solvers kernels stream)
  install(FILES tools/packaging/${floor}.h DESTINATION ${include_dir} COMPONENT library)
  install(DIRECTORY ${floor} DESTINATION ${include_dir}/floors COMPONENT library
    FILES_MATCHING PATTERN "*.h")
endforeach()

# The module, where the system's Python finds it.
if(TARGET tessera_python)
  install(DIRECTORY ${CMAKE_BINARY_DIR}/python/tessera DESTINATION lib/python3/dist-packages COMPONENT python OPTIONAL
    PATTERN __pycache__ EXCLUDE)
endif()

set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_VENDOR Tessera)
set(CPACK_PACKAGE_CONTACT "Tessera <tessera@localhost>")
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "3D scans of any size to triangle meshes, out of core")
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_COMPONENTS_ALL program library)
if(TARGET tessera_python)
  list(APPEND CPACK_COMPONENTS_ALL python)
endif()
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SECTION science)
set(CPACK_DEBIAN_PROGRAM_PACKAGE_NAME tessera)
set(CPACK_DEBIAN_PROGRAM_PACKAGE_SHLIBDEPS ON)
# OSMesa is loaded at run time, by what draws, and PROJ by sites on Earth.
set(CPACK_DEBIAN_PROGRAM_PACKAGE_DEPENDS "libosmesa6, libproj25")
set(CPACK_DEBIAN_PROGRAM_PACKAGE_RECOMMENDS python3)  # serves the page of `tessera view`
set(CPACK_COMPONENT_LIBRARY_DESCRIPTION "Headers and static libraries of Tessera, for C++ programs")
set(CPACK_DEBIAN_LIBRARY_PACKAGE_NAME libtessera-dev)
set(CPACK_DEBIAN_LIBRARY_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_LIBRARY_PACKAGE_DEPENDS "libexpat1-dev, libjpeg62-turbo-dev, libmeshoptimizer-dev, libmetis-dev, libpng-dev, libspdlog-dev, \
libsuitesparse-dev, libtbb-dev, libxxhash-dev, libzstd-dev, nlohmann-json3-dev, zlib1g-dev")
set(CPACK_COMPONENT_PYTHON_DESCRIPTION "Tessera for Python: jobs, readers, closest points, winding numbers")
set(CPACK_DEBIAN_PYTHON_PACKAGE_NAME python3-tessera)
set(CPACK_DEBIAN_PYTHON_PACKAGE_SECTION python)
set(CPACK_DEBIAN_PYTHON_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PYTHON_PACKAGE_DEPENDS "python3 (>= 3.11), python3 (<< 3.12), python3-numpy")
set(CPACK_DEBIAN_PYTHON_PACKAGE_RECOMMENDS tessera)  # commands that are no calls
include(CPack)
