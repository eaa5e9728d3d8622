#pragma once

namespace cadmorph {

/// Sets up malloc for large arrays that come and go; before anything is computed. Has no effect on
/// other C libraries than glibc, or where malloc is another (a sanitizer's).
void set_up_heap();

}  // namespace cadmorph
