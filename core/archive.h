#pragma once

namespace cereal {
class PortableBinaryInputArchive;
class PortableBinaryOutputArchive;
}  // namespace cereal

namespace cadmorph {

/// Where numbers go to and come from, bit by bit (cereal's portable binary archives). Sources that
/// use them include core/archive_types.h.
using InputArchive = cereal::PortableBinaryInputArchive;
using OutputArchive = cereal::PortableBinaryOutputArchive;

}  // namespace cadmorph
