// SPDX-License-Identifier: MIT
/** @file bit_access.hpp  Single bits of lanes: products of two words, and numbers as their bits. */
#ifndef HIL_LANES_WORDS_HPP
#define HIL_LANES_WORDS_HPP

#include "lanes.hpp"

namespace lanes {
inline namespace OMNI_LANES_LEVEL {

/** Both words of factor * a. */
template <int N>
LANES_INLINE void product(std::uint32_t factor, vectors<std::uint32_t, N> a, vectors<std::uint32_t, N> &high,
                          vectors<std::uint32_t, N> &low) {
    if constexpr (!fits<std::uint32_t, N>) {
        product<N / 2>(factor, a.low, high.low, low.low);
        product<N / 2>(factor, a.high, high.high, low.high);
    } else {
#if defined(LANES_SIXTEEN)
        static_assert(sizeof a == 64);
        const __m512i words = reinterpret_cast<__m512i>(a.v);
        const __m512i by = _mm512_set1_epi64(factor);
        const __m512i even = _mm512_mul_epu32(words, by);
        const __m512i odd = _mm512_mul_epu32(_mm512_srli_epi64(words, 32), by);
        const __m512i upper = _mm512_mask_blend_epi32(0xAAAA, _mm512_srli_epi64(even, 32), odd);
        const __m512i lower = _mm512_mask_blend_epi32(0xAAAA, even, _mm512_slli_epi64(odd, 32));
#elif defined(__AVX2__)
        const __m256i words = reinterpret_cast<__m256i>(a.v);
        const __m256i by = _mm256_set1_epi64x(factor);
        const __m256i even = _mm256_mul_epu32(words, by);
        const __m256i odd = _mm256_mul_epu32(_mm256_srli_epi64(words, 32), by);
        const __m256i upper = _mm256_blend_epi32(_mm256_srli_epi64(even, 32), odd, 0xAA);
        const __m256i lower = _mm256_blend_epi32(even, _mm256_slli_epi64(odd, 32), 0xAA);
#elif defined(__SSE2__)
        const __m128i words = reinterpret_cast<__m128i>(a.v);
        const __m128i by = _mm_set1_epi64x(factor);
        const __m128i even = _mm_mul_epu32(words, by);
        const __m128i odd = _mm_mul_epu32(_mm_srli_epi64(words, 32), by);
        const __m128i odd_words = _mm_set_epi32(-1, 0, -1, 0);
        const __m128i upper = _mm_or_si128(_mm_srli_epi64(even, 32), _mm_and_si128(odd, odd_words));
        const __m128i lower = _mm_or_si128(_mm_andnot_si128(odd_words, even), _mm_slli_epi64(odd, 32));
#endif
#if defined(__SSE2__)
        using native = typename vectors<std::uint32_t, N>::native;
        high.v = reinterpret_cast<native>(upper);
        low.v = reinterpret_cast<native>(lower);
#else
        for (int i = 0; i < N; ++i) {
            const std::uint64_t both = static_cast<std::uint64_t>(factor) * a.v[i];
            high.v[i] = static_cast<std::uint32_t>(both >> 32);
            low.v[i] = static_cast<std::uint32_t>(both);
        }
#endif
    }
}

LANES_INLINE void product(std::uint32_t factor, uint_t a, uint_t *high, uint_t *low) {
    product<count>(factor, a.v, high->v, low->v);
}

LANES_INLINE uint_t bits(real_t value) {
    return uint_t(as_bits<std::uint32_t>(value.v));
}

LANES_INLINE real_t of_bits(uint_t bits) {
    return real_t(as_bits<float>(bits.v));
}

} // namespace OMNI_LANES_LEVEL
} // namespace lanes

#endif
