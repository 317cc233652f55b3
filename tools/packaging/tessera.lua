-- Modulefile of Lmod for an install under a prefix: cmake --install build/release --prefix /opt/tessera/0.1.0, then put this file
-- as tessera/0.1.0.lua on the MODULEPATH.
local root = "/opt/tessera/" .. myModuleVersion()
help("3D scans of any size to triangle meshes, out of core; tessera --help")
whatis("Name: tessera")
whatis("Version: " .. myModuleVersion())
prepend_path("PATH", pathJoin(root, "bin"))
prepend_path("MANPATH", pathJoin(root, "share/man"))
prepend_path("CMAKE_PREFIX_PATH", root)
prepend_path("PYTHONPATH", pathJoin(root, "lib/python3/dist-packages"))
