#pragma once

/// Marks a kernel over planar float arrays that is worth a copy for wide registers: the loader
/// takes the copy that the machine can run, so what ships needs no -march. Sanitizers cannot follow
/// the choice, other processors have no such copies; both run the plain code.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && \
    !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define TABLETOP_SIMD_CLONES __attribute__((target_clones("default", "avx2")))
#else
#define TABLETOP_SIMD_CLONES
#endif
