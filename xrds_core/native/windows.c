// What Windows calls as it loads the library. Nothing is to be set up. MinGW's own start
// would do: zig would first compile all of MinGW's C library, which takes minutes.
#include <stdint.h>

int _fltused = 0;  // the compiler asks for it where floats are used

int __stdcall DllMainCRTStartup(void *library, uint32_t reason, void *reserved) {
    (void)library, (void)reason, (void)reserved;
    return 1;
}

// zig's name for it up to 0.16
int __stdcall _DllMainCRTStartup(void *library, uint32_t reason, void *reserved) {
    return DllMainCRTStartup(library, reason, reserved);
}
