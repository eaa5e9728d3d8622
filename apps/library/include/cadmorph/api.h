#pragma once

// The public names are members of cadmorph itself for whoever includes these headers; to the linker
// they are apart from those of the library's inner parts. Only the library's own sources define the
// macro otherwise.
#ifndef CADMORPH_V1
#define CADMORPH_V1 inline v1
#endif
