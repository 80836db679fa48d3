use super::FORMAT;
use crate::format::FileHead;
use crate::testing::{SpeciesParticles, read, scratch};
use crate::{Choice, Description, SpeciesMass};

fn open(text: &[u8]) -> particlegs_core::Result<(Description, SpeciesParticles)> {
    let file = scratch(text);
    let snapshot = (FORMAT.open)(&[file.path().to_path_buf()], &Choice::default())?;
    Ok((snapshot.description().clone(), read(&*snapshot, 0, &Choice::default())?))
}

fn detects(text: &[u8]) -> bool {
    let file = scratch(text);
    (FORMAT.detect)(&FileHead::read(file.path()).unwrap())
}

const TWO: [[f64; 3]; 2] = [[1.0, 2.0, 3.0], [4.0, 5.0, -6.5]];

#[test]
fn separators_headers_and_comments() {
    let texts = [
        "1,2,3\n4,5,-6.5\n",
        "x,y,z\r\n1,2,3\r\n4,5,-6.5",
        "\u{feff}id; \"X\" ;Y;Z\n7;1;2;3\n8;4;5;-6.5\n",
        "# x y z\n\n  1   2\t3 \n4 5 -6.5\n# the end\n",
        "z\ty\tx\tname\n3\t2\t1\t\n-6.5\t5\t4\ta b\n",
        "vx vy vz Points:0 Points:1 Points:2\n0 0 0 1 2 3\n0 0 0 4 5 -6.5\n",
        "name,Coordinates_0,Coordinates_1,Coordinates_2\n\"a, b\",\"1\", 2,3\nc,4,5,-6.5\n",
        "1.0D0 2 3\n4 5 -0.65d+1\n",
        "%x,y,z,\n1,2,3,\n4,5,-6.5,\n",
        // Spreadsheets: decimal commas, a line that states the separator, units below the names.
        "x;y;z\n1,0;2,0;3\n4;5;-6,5\n",
        "1,0\t2,0\t3,0\n4,0\t5,0\t-6,5\n",
        "1,0 2,0 3\n4 5 -6,5\n",
        "\"1,0\",\"2\",\"3\"\n\"4\",\"5\",\"-6,5\"\n",
        "sep=;\nid;x;y;z\n7;1;2;3\n8;4;5;-6.5\n",
        "\u{feff}sep=;\r\nx;y;z\r\n1,0;2,0;3,0\r\n4,0;5,0;-6,5\r\n",
        "name,x,y,z\n,kpc,kpc,kpc\na,1,2,3\nb,4,5,-6.5\n",
        // Columns with their numbers, as halo finders write them; numbers alone, as pandas does.
        "#ID(1)\thost(2)\tXc(3)\tYc(4)\tZc(5)\n7\t0\t1\t2\t3\n8\t0\t4\t5\t-6.5\n",
        "Zc(8),Xc(6),Yc(7)\n3,1,2\n-6.5,4,5\n",
        "0,1,2\n1.0,2.0,3.0\n4.0,5.0,-6.5\n",
        ",0,1,2\n0,1.0,2.0,3.0\n1,4.0,5.0,-6.5\n",
        ",x,y,z\n0,1,2,3\n1,4,5,-6.5\n",
        "#Z Y X\n#a = 0.5\n#Positions in kpc\n3 2 1\n-6.5 5 4\n",
        "#id X Y Z\n#Mass in solar masses\n7 1 2 3\n8 4 5 -6.5\n",
    ];
    for text in texts {
        let (_, got) = open(text.as_bytes()).unwrap_or_else(|e| panic!("{text:?}: {e} {}", e.hint()));
        assert_eq!(got.positions, TWO, "{text:?}");
        assert!(detects(text.as_bytes()), "{text:?}");
    }
}

#[test]
fn names_state_units_and_masses() {
    let (d, got) = open(b"x [kpc],y [kpc],z [kpc],Mass (Msun)\n1,2,3,10\n4,5,-6.5,20\n").unwrap();
    assert_eq!((d.meta.units.length_text(), d.meta.units.mass_text()), (Some("kpc"), Some("Msun")));
    assert_eq!((&d.species[0].positions[..], &d.species[0].mass), ("x,y,z", &SpeciesMass::Field("Mass".into())));
    assert_eq!((&got.positions[..], &got.weights[..]), (&TWO[..], &[10.0, 20.0][..]));
    for text in
        ["x;y;z;Mass\n[kpc];[kpc];[kpc];Msun\n1;2;3;10\n4;5;-6,5;20\n", "x y z mass n\nkpc kpc kpc Msun 1\n1 2 3 4 5\n"]
    {
        let (d, _) = open(text.as_bytes()).unwrap();
        assert_eq!((d.meta.units.length_text(), d.meta.units.mass_text()), (Some("kpc"), Some("Msun")), "{text}");
    }
    // Whole numbers alone are particles.
    assert_eq!(open(b"0,1,2\n3,4,5\n").unwrap().1.positions.len(), 2);
    let (d, _) = open(b"# x y z m [Mpc/h]\n1 2 3 4\n").unwrap();
    assert_eq!(d.meta.units.length_text(), Some("Mpc/h"));
    assert_eq!(d.species[0].fields[3].name, "m");
    let (d, _) = open(b"a a x y z\n1 2 3 4 5\n").unwrap();
    assert_eq!(d.species[0].fields[1].name, "a.2");
}

#[test]
fn faults_are_named() {
    let cases: [(&[u8], &str); 7] = [
        (b"x,y,z\n1,2,3\n4,5\n", "line 3 has 2 columns; expected 3"),
        (b"x,y,z\n1,2,3\n4,5,6,7\n", "line 3 has 4 columns; expected 3"),
        (b"x,y,z\n1,2,3\n\n4,,6\n", "line 4 column 2 (`y`): `` is not a number"),
        (b"x,y,z\n1,2,3\n4,\xff,6\n", "line 3 is not UTF-8 text"),
        (b"x,y,z\n1,2\0,3\n", "line 2 has the byte 0x00"),
        (b"# nothing\n\n", "there are no rows"),
        (b"a,b,c\n1,2,3\n", "no columns are named as positions"),
    ];
    for (text, expected) in cases {
        let message = open(text).err().map_or("it was read".into(), |e| e.to_string());
        assert!(message.contains(expected), "{message}");
    }
}

#[test]
fn other_texts_are_not_taken_for_tables() {
    let others: [&[u8]; 8] = [
        b"Call me Ishmael. Some years ago, never mind how long,\nhaving little or no money, in my purse\n",
        b"ATOM      1  N   MET A   1      27.340  24.430   2.614  1.00  9.67           N\n\
          ATOM      2  CA  MET A   1      26.266  25.413   2.842  1.00 10.38           C\n",
        b"{\"a\": [1, 2, 3],\n\"b\": [1, 2, 3]}\n",
        b"1,2\n3,4\n",
        b"\x00\x01\x02\n1 2 3\n",
        b"a,b,c\nd,e,f\n",
        b"                                  ",
        b"MD of water, t= 0.0\n 3\n    1SOL     OW    1   0.126   1.624   1.679\n    1SOL    HW1    2   0.190   1.661   1.747\n",
    ];
    for text in others {
        assert!(!detects(text), "{}", String::from_utf8_lossy(text));
    }
}
