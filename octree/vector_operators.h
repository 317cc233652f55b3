/// \file vector_operators.h
/// Operators of vectors for code outside of the namespace. A Double3 is std::array<double, 3>, whose arguments lead a lookup to std
/// alone; `using namespace tessera::operators;` lets it find these, and brings no other name along.
#pragma once
#include "octree/vector.h"

namespace tessera::operators {

using tessera::operator+;
using tessera::operator-;
using tessera::operator*;
using tessera::operator/;

}  // namespace tessera::operators
