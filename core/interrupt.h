#pragma once

#include <filesystem>

namespace cadmorph {

/// Makes an interrupt (SIGINT, SIGTERM, SIGHUP) remove all that stands as InterruptRemoval before
/// it ends the process as usual. For a program's start; signals that are ignored stay so.
void remove_temporaries_at_interrupt();

/// A file or folder to be removed, with all in it, should an interrupt end the process while the
/// object is.
class InterruptRemoval {
 public:
  explicit InterruptRemoval(std::filesystem::path path);
  ~InterruptRemoval();
  InterruptRemoval(const InterruptRemoval&) = delete;
  InterruptRemoval& operator=(const InterruptRemoval&) = delete;

 private:
  std::filesystem::path path_;
};

}  // namespace cadmorph
