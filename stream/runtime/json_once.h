/// \file json_once.h
/// The code of a JSON value, compiled once (json_once.cpp) and not in each of the files that touch one. It stands among
/// the precompiled headers of whoever links tessera_stream, so no file includes it; without them all is as ever.
#pragma once
#include <nlohmann/json.hpp>

extern template class nlohmann::basic_json<>;
