//! Every shader in every variant is valid, without a GPU.

use naga::valid::{Capabilities, ValidationFlags, Validator};
use spao_server::gpu::{Assembled, ShaderError, assemble, assemble_from, stems};

/// Levels of `ao_spao`; shaders without levels ignore the number.
const LEVELS: std::ops::RangeInclusive<u32> = 1..=8;

/// The fragment that replaces filtered look-ups where 16-bit textures cannot be filtered.
const BY_HAND: (&str, &str) = ("common/value_filtered", "common/value_texels");

/// The fragment that replaces levels in textures and stores to a 16-bit texture where there are none.
const WORDS: (&str, &str) = ("common/spao_sampled", "common/spao_words");

/// What every Vulkan, Metal and DirectX 12 adapter can do: enough for all variants with both replacements.
const BASELINE: Capabilities = Capabilities::SHADER_FLOAT16_IN_FLOAT32;

/// With the feature that the device is opened with where there is one: 16-bit normalised textures.
const WITH_16_BIT_TEXTURES: Capabilities = BASELINE.union(Capabilities::STORAGE_TEXTURE_16BIT_NORM_FORMATS);

/// Replacements and what an adapter must be able to do for the rest.
const VARIANTS: [(&[(&str, &str)], Capabilities); 2] = [(&[], WITH_16_BIT_TEXTURES), (&[BY_HAND, WORDS], BASELINE)];

fn validate(assembled: &Assembled, capabilities: Capabilities) -> Result<naga::Module, String> {
    let module = assembled.parse().map_err(|e| e.to_string())?;
    let mut validator = Validator::new(ValidationFlags::all(), capabilities);
    validator.validate(&module).map_err(|e| e.emit_to_string(&assembled.wgsl))?;
    Ok(module)
}

fn assembled(stem: &str, levels: u32, replaced: &[(&str, &str)]) -> Assembled {
    assemble(stem, &[("LEVELS", levels)], replaced).unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn every_shader_is_valid_in_every_variant() {
    let mut variants = 0;
    for stem in stems() {
        for levels in LEVELS {
            for (replaced, capabilities) in VARIANTS {
                let assembled = assembled(stem, levels, replaced);
                // What only serves measurements runs where there are such textures, and nowhere else.
                let capabilities = if stem.starts_with("bench_") { WITH_16_BIT_TEXTURES } else { capabilities };
                let module = validate(&assembled, capabilities).unwrap_or_else(|e| panic!("{stem}: {e}"));
                assert_eq!(module.entry_points.len(), 1, "{stem} is one pass");
                assert_eq!(module.entry_points[0].name, "main");
                assert_eq!(module.entry_points[0].stage, naga::ShaderStage::Compute);
                variants += 1;
            }
        }
    }
    assert!(variants >= 11 * 2 * 8, "{variants}");
}

#[test]
fn the_validation_notices_a_wrong_type_and_a_capability_that_was_not_asked_for() {
    let check = |text: &'static str| {
        let assembled = assemble_from(&[("pass", text)], "pass", &[], &[]).expect("nothing to import");
        validate(&assembled, BASELINE).map(|_| ())
    };
    assert_eq!(check("@compute @workgroup_size(8)\nfn main() {}"), Ok(()));
    check("@compute @workgroup_size(8)\nfn main() { let a: f32 = 1u; }").expect_err("u32 is not f32");
    check("@compute @workgroup_size(8)\nfn main() { let a = 1.0lf; }").expect_err("64-bit floats need a feature");
    validate(&assembled("ao_spao", 6, &[]), BASELINE).expect_err("storing 16-bit normalised texels needs a feature");
}

#[test]
fn a_variant_declares_one_binding_per_level() {
    for levels in LEVELS {
        for (replaced, capabilities) in VARIANTS {
            let assembled = assembled("ao_spao", levels, replaced);
            let module = validate(&assembled, capabilities).unwrap_or_else(|e| panic!("{e}"));
            let names = module.global_variables.iter().filter_map(|(_, v)| v.name.as_deref());
            let declared = names.filter(|name| name.starts_with("level_")).count();
            assert_eq!(declared, levels as usize + 1);
        }
    }
}

#[test]
fn the_variant_without_filtering_has_neither_the_filtered_texture_nor_a_second_copy_of_it() {
    let names = |replaced: &[(&str, &str)]| -> Vec<String> {
        let module = assembled("raycast", 1, replaced).parse().unwrap_or_else(|e| panic!("{e}"));
        module.global_variables.iter().filter_map(|(_, v)| v.name.clone()).collect()
    };
    let has = |names: &[String], name: &str| names.iter().filter(|n| *n == name).count();
    let (filtered, by_hand) = (names(&[]), names(&[BY_HAND]));
    assert_eq!((has(&filtered, "value_texture"), has(&filtered, "value_texels")), (1, 0));
    assert_eq!((has(&by_hand, "value_texture"), has(&by_hand, "value_texels")), (0, 1));
}

#[test]
fn every_line_of_an_assembled_shader_is_the_line_of_the_file_it_names() {
    for stem in stems() {
        let assembled = assembled(stem, 2, &[]);
        assert_eq!(assembled.wgsl.lines().count(), assembled.origins.len());
        for (text, &(file, line)) in assembled.wgsl.lines().zip(&assembled.origins) {
            let path = format!("{}/shaders/{file}.wgsl", env!("CARGO_MANIFEST_DIR"));
            let source = std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{path}: {e}"));
            let written = source.lines().nth(line as usize - 1).expect("the file has this line");
            let same = written == text || written.contains('@') && written.len() >= text.len();
            assert!(same, "{file}:{line} is `{written}`, not `{text}`");
        }
    }
}

#[test]
fn a_missing_value_for_the_levels_is_an_error_at_the_line_that_asks_for_it() {
    let error: ShaderError = assemble("ao_spao", &[], &[]).expect_err("LEVELS has no value");
    assert_eq!(error.file, "common/spao_sampled");
    assert!(error.line > 1 && error.message.contains("`LEVELS` has no value"), "{error}");
}
